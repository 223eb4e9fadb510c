"""A small result with its history and its manifest, written by hand: what the record is tested on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

COMMIT = "0123456789abcdef0123456789abcdef01234567"
OLDER, NEWER, KILLED = "20261121T100000Z-00000001", "20261122T080253Z-3f9a1c2e", "20261122T070000Z-00000002"
CONFIG = {"name": "little", "systems": ["kepler"], "experiments": {"paper": {"t_end": {"kepler": "100"}}}}
VERSIONS = {
    "python": "3.11.7", "nearharmonic": "0.1.0", "numpy": "2.4.6", "numba": "0.68.1", "llvmlite": "0.50.0",
    "mpmath": "1.3.0", "gmpy2": "2.2.1", "xarray": "2026.1.0", "h5py": "3.16.0", "h5netcdf": "1.6.1",
    "matplotlib": "3.10.0", "bokeh": "3.8.0", "snakemake": "9.27.0",
}  # fmt: skip

#: Files of the result: bytes, and the run that made them.
FILES = {
    "cubes/kepler.h5": (b"\x89HDF\r\n\x1a\n" + bytes(range(200)), NEWER),
    "cubes/sho.h5": (b"\x89HDF\r\n\x1a\n" + bytes(range(100)), OLDER),
    "derived/coefficients.toml": (b"[ruth]\n", NEWER),
    "figures/fig5_kepler.svg": (b"<svg/>\n", NEWER),
    "figures/fig5_kepler.png": (b"\x89PNG", NEWER),
    "report.html": (b"<!doctype html>\n", NEWER),
    "runs/kepler/ruth/0.h5": (b"\x89HDF trajectories", NEWER),
    "tables/claims.json": (b"[]\n", NEWER),
    "tables/skipped.csv": ("system,why\nHénon,τ\n".encode(), NEWER),
    "tables/skipped.tex": (b"", NEWER),
    "tables/100% of steps.csv": (b"1\n", NEWER),
}


def run(identifier: str, start: str, end: str | None, **other: object) -> dict[str, object]:
    """A line of the history of a run that went well, but for ``other``."""
    return {
        "id": identifier, "work": "ab" * 32, "status": "ok", "exit_status": 0, "start": start, "end": end,
        "duration": 23.41, "cpu_seconds": 40.5, "cores": 2, "command": ["snakemake", "-j2"], "targets": ["all"],
        "commit": COMMIT, "dirty": False, "config": CONFIG, "config_digest": "cd" * 32, "code_digest": "c" * 64,
        "coefficients_digest": "d" * 64, "versions": VERSIONS, "platform": "Linux-6.1-x86_64",
        "cpu": {"model": "Fast 9", "features": ["avx2"]}, "jobs_run": 46, "jobs_reused": 0,
        "evaluations": 4160000000, "evaluations_skipped": None,
    } | other  # fmt: skip


#: Oldest first: with other settings and uncommitted changes, killed, and the newest.
HISTORY = [
    run(OLDER, "2026-11-21T10:00:00.000Z", "2026-11-21T10:00:20.000Z", dirty=True, config=CONFIG | {"name": "older"}),
    run(
        KILLED, "2026-11-22T07:00:00.000Z", None, status="killed", exit_status=None, duration=None, cpu_seconds=None,
        commit=None, dirty=None,
    ),
    run(NEWER, "2026-11-22T08:02:53.123Z", "2026-11-22T08:03:16.533Z"),
]  # fmt: skip


def entry(content: bytes, identifier: str) -> dict[str, object]:
    """The entry of a file in the manifest."""
    return {
        "size": len(content), "sha256": hashlib.sha256(content).hexdigest(),
        "function": "nearharmonic_paper.experiments.paper.reductions:reduce",
        "code": "23" * 32, "coefficients": "45" * 32,
        "run": identifier,
        "systems": ["kepler"], "integrators": ["ruth"], "volatile": [],
    }  # fmt: skip


def write_manifest(folder: Path, files: dict[str, dict[str, object]]) -> None:
    """Write the manifest of a folder from the entries of its files."""
    manifest = {"format": "nearharmonic manifest 1", "files": files, "changed": []}
    text = json.dumps(manifest, sort_keys=True, ensure_ascii=False)
    manifest["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1))


def write_history(folder: Path, lines: list[dict[str, object]]) -> None:
    """Write lines as the history of a folder."""
    (folder / "history.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))


def write_result(folder: Path) -> Path:
    """Write the result to ``folder`` and return it."""
    for path, (content, _) in FILES.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    (folder / "logs").mkdir(parents=True)
    (folder / "logs" / "reduce.log").write_text("not archived")
    write_manifest(folder, {path: entry(*made) for path, made in sorted(FILES.items())})
    write_history(folder, HISTORY)
    return folder
