"""Cost of many runs: the workflow on ever finer grids, of the ten methods of the paper on the Hénon-Heiles system.

Run: ``python benchmarks/large_grids.py`` for up to a million runs (a quarter of an hour), or ``--finest 2500`` for a
hundred thousand; ``--page`` writes the table to ``docs/how_to/large_grids.md``.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from timing import asked, show

from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes

PAGE = "docs/how_to/large_grids.md"
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


def costs(arguments: list[str], folder: Path) -> tuple[float, int]:
    """CPU seconds of the workflow with ``arguments``, and the largest memory of one of its processes in bytes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "snakemake", "-j2", "--snakefile", str(ROOT / "Snakefile"), "--quiet", "all"]
    command += ["--workflow-profile", str(ROOT / "profiles/default"), "--configfile", "grid.yaml", *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, after.ru_maxrss * 1024


def row(points_per_decade: int) -> tuple[float, ...]:
    """Numbers of one grid, in the order of the columns, in seconds and bytes."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "grid.yaml").write_text(CONFIG.format(points=points_per_decade), encoding="utf-8")
        cube, kernels = "results/grid/cubes/henon_heiles.h5", "results/grid/logs/compile/henon_heiles.done"
        costs(["--", kernels], folder)
        plan, _ = costs(["--dry-run", "--", cube], folder)
        begin = time.monotonic()
        made, memory = costs(["--", cube], folder)
        took = time.monotonic() - begin
        drawn, _ = costs(["--", "results/grid/figures/fig3_henon_heiles.png"], folder)
        files = [path for path in (folder / "results/grid").rglob("*.h5") if "logs" not in path.parts]
        shards = sum("runs" in path.parts for path in files)
        size = sum(path.stat().st_size for path in files)
    runs = 10 * (4 * points_per_decade + 1)
    return runs, plan, shards, len(files), made / runs, took, drawn, memory, size / runs


def measured(finest: int) -> list[tuple[float, ...]]:
    """Numbers of each grid."""
    return [row(points) for points in (25, 250, 2500, 25_000, 250_000) if points <= finest]


def parts(grids: list[tuple[float, ...]], machine: str) -> dict[str, str]:
    """The table of the page."""
    rows = [
        [f"{runs:,}", f"{plan:.1f} s", shards, files, f"{made * 1e6:.0f} µs", f"{took:.0f} s", f"{drawn:.1f} s",
         f"{memory / 1e6:.0f} MB", f"{size:.0f}"]
        for runs, plan, shards, files, made, took, drawn, memory, size in grids
    ]  # fmt: skip
    return {"grids": "\n".join([*pipes(COLUMNS, rows, align="r"), "", f"Machine: {machine}."])}


def main() -> None:
    options = asked(__doc__, 25_000, "finest", "step sizes per decade of the finest grid", page=PAGE)
    show(parts(measured(options.finest), processor()), PAGE, options.page)


if __name__ == "__main__":
    main()
