"""Cases of kills, damage, bad input, hostile results and numerical stress: how many were tried, held and failed.

Run: ``python benchmarks/trials.py --quick`` for the cases of each change (two minutes), ``python benchmarks/trials.py``
for all of them (hours). The table is that of ``docs/developers/trials.md``; the exit status is 1 if a case failed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

HEAD = "| cases | tried | held | failed |\n|---|---:|---:|---:|\n"


def counted(quick: bool) -> dict[str, dict[str, int]]:
    """Counts of each kind of cases: those of the tests that count their cases."""
    chosen = ["-m", f"not slurm and not browser{' and not long' if quick else ''}"]
    with tempfile.TemporaryDirectory() as folder:
        counts = Path(folder) / "trials.json"
        subprocess.run([sys.executable, "-m", "pytest", "-q", *chosen, "--trials", str(counts)], check=False)
        return json.loads(counts.read_text(encoding="utf-8")) if counts.exists() else {}


def table(counts: dict[str, dict[str, int]]) -> str:
    """Markdown table of the counts."""
    rows = [
        f"| {kind} | {one['tried']} | {one['tried'] - one['failed']} | {one['failed']} |"
        for kind, one in counts.items()
    ]
    return HEAD + "\n".join(rows) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="the cases of each change, without campaigns")
    counts = counted(parser.parse_args().quick)
    print(table(counts))
    return 1 if not counts or any(one["failed"] for one in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
