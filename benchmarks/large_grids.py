"""Cost of many runs: the workflow on ever finer grids, of the ten methods of the paper on the Hénon-Heiles system.

Run: ``python benchmarks/large_grids.py`` for up to a million runs (some minutes), or ``--finest 2500`` for a hundred
thousand. The table is that of ``docs/how_to/large_grids.md``.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
CONFIG = """
name: grid
integrators: [ruth, s5odr4, aba104, aba864, aba1064, yoshida_s7o6a, abas5o6h, babs7o7h, babps8o7h, babps9o7h]
systems:
  henon_heiles:
    t_end: 50
    tau_per_stage: {{lowest: 1.0e-4, highest: 1, points_per_decade: {points}}}
samples: 0
"""
COLUMNS = (
    "runs", "CPU time of the plan", "jobs of runs", "files", "CPU time a run", "time on two cores",
    "CPU time of the figure", "memory of the largest process", "bytes a run",
)  # fmt: skip


def measured(arguments: list[str], folder: Path) -> tuple[float, int]:
    """CPU seconds of the workflow with ``arguments``, and the largest memory of one of its processes in bytes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "snakemake", "-j2", "--snakefile", str(ROOT / "Snakefile"), "--quiet", "all"]
    command += ["--workflow-profile", str(ROOT / "profiles/default"), "--configfile", "grid.yaml", *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, after.ru_maxrss * 1024


def row(points_per_decade: int) -> str:
    """Row of the table for one grid."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "grid.yaml").write_text(CONFIG.format(points=points_per_decade), encoding="utf-8")
        cube, kernels = "results/grid/cubes/henon_heiles.h5", "results/grid/logs/compile/henon_heiles.done"
        measured(["--", kernels], folder)
        plan, _ = measured(["--dry-run", "--", cube], folder)
        begin = time.monotonic()
        made, memory = measured(["--", cube], folder)
        took = time.monotonic() - begin
        drawn, _ = measured(["--", "results/grid/figures/fig3_henon_heiles.png"], folder)
        files = [path for path in (folder / "results/grid").rglob("*.h5") if "logs" not in path.parts]
        shards = sum("runs" in path.parts for path in files)
        size = sum(path.stat().st_size for path in files)
    runs = 10 * (4 * points_per_decade + 1)
    return (
        f"| {runs:,} | {plan:.1f} s | {shards} | {len(files)} | {made / runs * 1e6:.0f} µs | {took:.0f} s | "
        f"{drawn:.1f} s | {memory / 1e6:.0f} MB | {size / runs:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--finest", type=int, default=25_000, help="step sizes per decade of the finest grid")
    finest = parser.parse_args().finest
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---:|" * len(COLUMNS))
    for points in (25, 250, 2500, 25_000, 250_000):
        if points <= finest:
            print(row(points), flush=True)


if __name__ == "__main__":
    main()
