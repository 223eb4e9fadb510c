"""A process that has Snakemake's modules loaded and forks for each command: loading them takes most of a dry run.

A request is a line of JSON on the standard input: folder, arguments, environment, the file to print to, and
limits of resources by name. The answer is a line with the exit status.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import runpy
import sys

#: Nothing of the package: each command loads the package of its own folder.
LOADED = (
    "docutils.core", "jinja2", "mpmath", "nbformat", "numpy", "pydantic.dataclasses", "requests", "smart_open",
    "snakemake.cli", "snakemake.report.html_reporter", "snakemake.script", "yte",
)  # fmt: skip


def run(folder: str, arguments: list[str], environment: dict[str, str], printed: str, limits: dict[str, int]) -> int:
    """Run ``python -m snakemake`` in this process; return its exit status."""
    output = os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for given, stream in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(given, stream)
    for name, most in limits.items():
        resource.setrlimit(getattr(resource, name), (most, most))
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:1] = ["", *environment["PYTHONPATH"].split(os.pathsep)]
    sys.argv = ["snakemake", *arguments]
    try:
        runpy.run_module("snakemake", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


if __name__ == "__main__":
    for name in LOADED:
        importlib.import_module(name)
    for line in sys.stdin:
        if not (child := os.fork()):
            status = run(**json.loads(line))
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
