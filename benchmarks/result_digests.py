"""Digests of the numbers in a results folder, and their comparison with another folder.

    python benchmarks/result_digests.py results/smoke > before.json
    python benchmarks/result_digests.py results/smoke --against before.json

A digest covers the values of one dataset of an HDF5 file (type, shape and bytes, whatever its attributes), or the text
of one table. Attributes hold provenance, which every change of the code changes. Files and columns of measured times,
as the manifest of the results names them, are left out. ``nearharmonic compare`` says by how much two results differ.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np

WHOLE = "*"


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 by name: ``file:dataset`` for each dataset below ``folder``, ``file`` for each table."""
    files = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["files"]
    found: dict[str, str] = {}
    for name, entry in sorted(files.items()):
        path, volatile = folder / name, entry["volatile"]
        if WHOLE in volatile:
            continue
        if path.suffix == ".h5":
            found |= {f"{name}:{key}": digest for key, digest in _datasets(path) if key not in volatile}
        elif path.suffix == ".csv":
            found[name] = sha256(_without(volatile, path).encode()).hexdigest()
        elif path.suffix in {".md", ".tex"} and not volatile:
            found[name] = sha256(path.read_bytes()).hexdigest()
    return found


def _datasets(path: Path) -> Iterator[tuple[str, str]]:
    with h5py.File(path) as file:
        names: list[str] = []
        file.visititems(lambda name, member: names.append(name) if isinstance(member, h5py.Dataset) else None)
        for name in sorted(names):
            values = file[name][()]
            if isinstance(values, np.ndarray) and values.dtype == object:
                values = values.astype("S")
            described = f"{np.asarray(values).dtype} {np.shape(values)}".encode()
            yield name, sha256(described + np.asarray(values).tobytes()).hexdigest()


def _without(columns: list[str], table: Path) -> str:
    """The text of a CSV table without some columns."""
    with table.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    kept = [i for i, column in enumerate(header) if column not in columns]
    return "\n".join(",".join(row[i] for i in kept) for row in [header, *rows])


def main() -> int:
    """Print the digests as JSON, or the differences from a file of them; status 1 if there are any."""
    parser = argparse.ArgumentParser(description="Digests of the numbers in a results folder.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--against", type=Path, help="a file of digests, printed by this program before")
    chosen = parser.parse_args()
    now = digests(chosen.folder)
    if chosen.against is None:
        json.dump(now, sys.stdout, indent=1)
        return 0
    before = json.loads(chosen.against.read_text(encoding="utf-8"))
    changes = {
        "different": sorted(name for name in now.keys() & before.keys() if now[name] != before[name]),
        "missing": sorted(before.keys() - now.keys()),
        "new": sorted(now.keys() - before.keys()),
    }
    equal = sum(now[name] == before[name] for name in now.keys() & before.keys())
    print(f"{equal} equal, " + ", ".join(f"{len(names)} {kind}" for kind, names in changes.items()))
    for kind, names in changes.items():
        for name in names:
            print(f"  {kind}: {name}")
    return 1 if changes["different"] or changes["missing"] else 0


if __name__ == "__main__":
    sys.exit(main())
