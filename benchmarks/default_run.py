"""Times of the workflow: CPU seconds of each rule, and ratios to another checkout.

Run: ``python benchmarks/default_run.py`` for the default run from an empty kernel cache, and with ``fig3`` or
``--configfile config/smoke.yaml`` for less. ``--against ../other`` runs both checkouts in turns, each with the Python
of its ``.venv``, and prints the ratios of the cases in ``--cases``. Both run in copies: no checkout gets results.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from timing import ROOT, parser_of

from nearharmonic.output.table import pipes

#: What a copy of a checkout has.
PARTS = ("Snakefile", "workflow", "config", "profiles", "src", "docs", "examples", "benchmarks", "pyproject.toml")
SMOKE = ("--configfile", "config/smoke.yaml")
#: Cases by name: targets and options, and if the kernel cache and the results are removed before.
CASES = {
    "default": ((), True),
    "nothing": ((), False),
    "warm": (("-F",), False),
    "smoke": (SMOKE, True),
    "fig3": (("fig3",), True),
}
WORDS = {
    "default": "default, empty kernel cache",
    "nothing": "second run, nothing to do",
    "warm": "default with warm kernels (-F)",
    "smoke": "smoke, empty kernel cache",
    "fig3": "fig3 alone, empty kernel cache",
}
#: Rules with a job for each system or run, which are one row.
MANY = ("integrate", "compile")


@dataclass(frozen=True)
class Run:
    """Wall and CPU seconds of a run, with all processes; and of each job that has a receipt, by its log."""

    wall: float
    cpu: float
    jobs: dict[str, float] = field(default_factory=dict)

    def by_rule(self) -> dict[str, list[float]]:
        """The CPU seconds of the jobs of each row."""
        rows = defaultdict(list)
        for log, seconds in self.jobs.items():
            rule, _, rest = log.partition("/")
            rows[rule if rule in MANY or not rest else log].append(seconds)
        return rows


class Copy:
    """A copy of a checkout in ``folder``, whose kernels and results are its own."""

    def __init__(self, tree: Path, folder: Path, python: Path | str) -> None:
        self._folder, self._python = folder, python
        for name in PARTS:
            if (tree / name).is_dir():
                shutil.copytree(tree / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
            elif (tree / name).exists():
                shutil.copy(tree / name, folder)
        # A user's second run finds compiled Python code, and the first one would time the writing of it.
        subprocess.run([python, "-m", "compileall", "-q", "src"], cwd=folder, check=True)

    def run(self, arguments: Sequence[str], cores: int, *, is_cold: bool) -> Run:
        """Run the workflow."""
        kernels = self._folder / "kernels"
        for place in (kernels, self._folder / "results", self._folder / ".snakemake") if is_cold else ():
            shutil.rmtree(place, ignore_errors=True)
        own = {"XDG_CACHE_HOME": str(kernels), "PYTHONPATH": str(self._folder / "src")}
        kept = {key: text for key, text in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        command = [str(self._python), "-m", "snakemake", f"-j{cores}", *arguments]
        before, began, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), time.time_ns()
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        done = subprocess.run(command, cwd=self._folder, env=kept | own, check=False, **streams)
        wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(f"{' '.join(command)} in {self._folder}:\n{done.stdout.decode()}")
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Run(wall, cpu, dict(self._receipts(start)))

    def _receipts(self, start: int) -> Iterator[tuple[str, float]]:
        """Yield the log of each job since ``start`` (ns), without its suffix, and its CPU seconds."""
        for logs in self._folder.glob("results/*/logs"):
            for place in logs.rglob("*.json"):
                if place.stat().st_mtime_ns >= start:
                    told = json.loads(place.read_bytes())
                    if "cpu_seconds" in told:
                        yield place.relative_to(logs).with_suffix("").as_posix(), told["cpu_seconds"]


@contextmanager
def copied(*trees: Path) -> Iterator[list[Copy]]:
    """Copy checkouts; this one runs with this Python, and others with the Python of their ``.venv``."""
    with tempfile.TemporaryDirectory() as place:
        folders = [Path(place, str(number)) for number in range(len(trees))]
        for folder in folders:
            folder.mkdir()
        pythons = [sys.executable if tree == ROOT else tree.resolve() / ".venv/bin/python" for tree in trees]
        yield [Copy(*each) for each in zip(trees, folders, pythons, strict=True)]


def table_of(run: Run) -> str:
    """The CPU seconds of a run by rule, largest first, and what no job accounts for."""
    rows = sorted(run.by_rule().items(), key=lambda row: -sum(row[1]))
    lines = [[name, len(jobs), f"{sum(jobs):.2f}"] for name, jobs in rows]
    lines.append(["Snakemake, and what jobs share", "", f"{run.cpu - sum(run.jobs.values()):.2f}"])
    lines.append([f"all, in {run.wall:.1f} s", len(run.jobs), f"{run.cpu:.2f}"])
    return "\n".join(pipes(["job", "jobs", "CPU s"], lines, align="lrr"))


def ratios(trees: Iterable[Copy], cases: Sequence[str], repeats: int, cores: int) -> str:
    """The smallest times of each case here and there, and their ratios; all checkouts take turns."""
    copies = list(trees)
    runs: dict[tuple[str, int], list[Run]] = defaultdict(list)
    for _ in range(repeats):
        for case in cases:
            arguments, is_cold = CASES[case]
            for number, copy in enumerate(copies):
                runs[case, number].append(copy.run(arguments, cores, is_cold=is_cold))
    lines = []
    for case in cases:
        wall, cpu = ([min(getattr(run, what) for run in runs[case, n]) for n in (0, 1)] for what in ("wall", "cpu"))
        lines.append([WORDS[case], *(f"{x:.2f}" for x in (*wall, wall[0] / wall[1], *cpu, cpu[0] / cpu[1]))])
    return "\n".join(pipes(["run", "wall s", "there", "ratio", "CPU s", "there", "ratio"], lines, align="lrrrrrr"))


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("targets", nargs="*", help="targets of the run (default: the workflow's)")
    parser.add_argument("--configfile", help="config of the run (default config/config.yaml)")
    parser.add_argument("--cores", type=int, default=2, help="jobs at once (default 2)")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="another checkout, with a .venv")
    words = f"cases that are compared: {', '.join(CASES)} (default: all); nothing and warm follow default"
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), help=words)
    parser.add_argument("--repeats", type=int, default=3, help="runs of each case, of which the shortest counts")
    options = parser.parse_args()
    if options.against:
        with copied(ROOT, options.against) as both:
            print(ratios(both, options.cases, options.repeats, options.cores))
    else:
        given = [*options.targets, *(["--configfile", options.configfile] if options.configfile else [])]
        with copied(ROOT) as (copy,):
            print(table_of(copy.run(given, options.cores, is_cold=True)))


if __name__ == "__main__":
    main()
