"""A copy of the project to run Snakemake in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TINY = ("--configfile", "config/tiny.yaml")


class Project:
    """Workflow, package and the config of the tests, copied to ``folder``; Snakemake there uses the copied package."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("workflow", "config", "profiles", "src"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        shutil.copy(ROOT / "Snakefile", folder)
        shutil.copy(ROOT / "tests/workflow/tiny.yaml", folder / "config")

    def snakemake(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """``snakemake`` with ``arguments``; what it prints is in ``stdout``, errors included."""
        return subprocess.run(
            [sys.executable, "-m", "snakemake", *arguments],
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": str(self.folder / "src")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

    def jobs(self, *arguments: str) -> dict[str, int]:
        """What a dry run with ``arguments``, targets first, would do: rule -> number of jobs."""
        done = self.snakemake(*arguments, "-n", "--quiet", "rules")
        assert done.returncode == 0, done.stdout
        rows = [line.split() for line in done.stdout.splitlines()]
        return {row[0]: int(row[1]) for row in rows if len(row) == 2 and row[1].isdigit() and row[0] != "total"}
