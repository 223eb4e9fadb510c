"""A copy of the project to run Snakemake in."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[3]
TINY = ("--configfile", "config/tiny.yaml")


@cache
def _server() -> subprocess.Popen[str]:
    """The process that runs Snakemake; it ends with this one, which holds its standard input."""
    command = [sys.executable, str(ROOT / "tests/support/projects/snakemake_server.py")]
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(server.communicate)
    return server


class Project:
    """Workflow, package and the config of the tests, copied to ``folder``; Snakemake there uses the copied package."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("workflow", "config", "profiles", "src"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        for name in ("Snakefile", "LICENSE", "CITATION.cff", "pyproject.toml"):
            shutil.copy(ROOT / name, folder)
        sections = [
            ROOT / "tests/workflow/tiny.yaml",
            *sorted([*ROOT.glob("tests/paper/experiments/*/tiny.yaml"), *ROOT.glob("tests/studies/*/tiny.yaml")]),
        ]
        texts = [path.read_text(encoding="utf-8") for path in sections]
        (folder / "config/tiny.yaml").write_text("\n".join(texts), encoding="utf-8")

    def copy(self, folder: Path) -> Project:
        """The project with its results and its times as they are, in ``folder``, to break things in."""
        shutil.copytree(self.folder, folder, symlinks=True)
        other = Project.__new__(Project)
        other.folder = folder
        return other

    def snakemake(self, *arguments: str, **limits: int) -> subprocess.CompletedProcess[str]:
        """``snakemake`` with ``arguments`` and limits such as ``RLIMIT_FSIZE``; ``stdout`` has errors, too."""
        printed = self.folder.with_name(f"{self.folder.name}.printed")
        server = _server()
        request = {"folder": str(self.folder), "arguments": arguments, "printed": str(printed), "limits": limits}
        server.stdin.write(json.dumps(request | {"environment": self._environment}) + "\n")
        server.stdin.flush()
        status = int(server.stdout.readline())
        return subprocess.CompletedProcess(arguments, status, printed.read_text(encoding="utf-8"))

    def nearharmonic(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """The command ``nearharmonic`` with ``arguments``."""
        return self._run("nearharmonic.cli", *arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def python(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """``python`` with ``arguments``."""
        return self._run("", *arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def _run(self, module: str, *arguments: str, **streams: int) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *(["-m", module] if module else []), *arguments]
        return subprocess.run(command, cwd=self.folder, env=self._environment, text=True, check=False, **streams)

    @property
    def _environment(self) -> dict[str, str]:
        # Python keeps what it compiled of the copy, which dozens of processes load.
        kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        return {**kept, "PYTHONPATH": str(self.folder / "src")}

    @property
    def results(self) -> Path:
        """The folder of results of the tiny config."""
        return self.folder / "results/tiny"

    def history(self) -> list[dict[str, Any]]:
        """The runs of the tiny config."""
        return [json.loads(line) for line in (self.results / "history.jsonl").read_text().splitlines()]

    def manifest(self) -> dict[str, Any]:
        """The manifest of the tiny config."""
        return json.loads((self.results / "manifest.json").read_text())

    def jobs(self, *arguments: str) -> dict[str, int]:
        """Jobs of a dry run with ``arguments``, targets first: rule -> number of jobs."""
        done = self.snakemake(*arguments, "-n", "--quiet", "rules")
        assert done.returncode == 0, done.stdout
        rows = [line.split() for line in done.stdout.splitlines()]
        return {row[0]: int(row[1]) for row in rows if len(row) == 2 and row[1].isdigit() and row[0] != "total"}
