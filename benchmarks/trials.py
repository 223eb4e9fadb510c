"""Cases of kills, damage, bad input, hostile results and numerical stress: how many were tried, held and failed.

Run: ``python benchmarks/trials.py --quick`` for the cases of each change (two minutes), ``python benchmarks/trials.py``
for all of them (hours). ``--page`` writes the table to ``docs/developers/testing.md``; the exit status is 1 if a case
failed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from timing import parser_of, show

from nearharmonic.output.table import pipes

PAGE = "docs/developers/testing.md"


def measured(quick: bool) -> dict[str, dict[str, int]]:
    """Counts of each kind of cases, from the tests that count their cases."""
    chosen = ["-m", f"not slurm and not browser{' and not long' if quick else ''}"]
    with tempfile.TemporaryDirectory() as folder:
        counts = Path(folder) / "trials.json"
        subprocess.run([sys.executable, "-m", "pytest", "-q", *chosen, "--trials", str(counts)], check=False)
        return json.loads(counts.read_text(encoding="utf-8")) if counts.exists() else {}


def parts(counts: dict[str, dict[str, int]], quick: bool) -> dict[str, str]:
    """The table of the page, for the quick cases or for all."""
    rows = [(kind, one["tried"], one["tried"] - one["failed"], one["failed"]) for kind, one in counts.items()]
    table = pipes(["cases", "tried", "held", "failed"], rows, align="lr")
    return {"quick" if quick else "campaigns": "\n".join(table)}


def main() -> int:
    parser = parser_of(__doc__, PAGE)
    parser.add_argument("--quick", action="store_true", help="the cases of each change, without campaigns")
    options = parser.parse_args()
    counts = measured(options.quick)
    show(parts(counts, options.quick), PAGE, options.page if counts else None)
    return 1 if not counts or any(one["failed"] for one in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
