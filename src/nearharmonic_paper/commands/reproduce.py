"""``nearharmonic reproduce``: the workflow in a folder of one's own, from the installed package."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from nearharmonic.output.answers import Answer

HELP = "put the workflow into this folder, if it is not there, and run it"
#: Files of the workflow, by patterns from its root, which has all of them.
PARTS = ("Snakefile", "workflow/**/*", "config/*", "profiles/**/*")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="targets of the workflow (default all)")
    parser.add_argument(
        "--config", metavar="FILE", help="a config in place of config/config.yaml, which is the paper's"
    )
    parser.add_argument("-j", dest="jobs", default="2", metavar="N", help="jobs at a time (default 2)")


def answer(chosen: argparse.Namespace) -> Answer:
    """Run Snakemake in the working directory; the exit status is 1 if a job failed, 2 for bad input."""
    import subprocess

    from nearharmonic.engine.settings import whole_number
    from nearharmonic.errors import bad_setting
    from nearharmonic_paper.config import read_mapping
    from nearharmonic_paper.record.description import workflow_root

    jobs = whole_number(chosen.jobs, "-j")
    if jobs < 1:
        raise bad_setting("-j", chosen.jobs, "an integer of at least 1")
    if chosen.config is not None and not any((root / chosen.config).is_file() for root in (Path(), workflow_root())):
        raise bad_setting("config", chosen.config, "a file that exists, or one of the workflow: config/smoke.yaml")
    put_into(Path())
    if chosen.config is not None:  # Snakemake would run the Python of a template
        read_mapping(chosen.config)
    config = [] if chosen.config is None else ["--configfile", chosen.config]
    # Targets stand behind --, as --configfile would take them for further configs.
    words = [sys.executable, "-m", "snakemake", f"-j{jobs}", *config, "--", *chosen.targets]
    status = subprocess.run(words, check=False).returncode
    return Answer(header=(), rows=(), document={"status": status}, status=status if status in (0, 2) else 1, text="")


def put_into(folder: Path) -> None:
    """Copy the files of the workflow that are not in ``folder``; those that are there stay as they are."""
    from nearharmonic.errors import bad_setting
    from nearharmonic.output.atomic import write_bytes
    from nearharmonic_paper.record.description import workflow_root

    root = workflow_root()
    there = folder / "Snakefile"
    if there.exists() and there.read_bytes() != (root / "Snakefile").read_bytes():
        what = "an empty folder, or one with the workflow of this version: this Snakefile is another one"
        raise bad_setting("folder", str(folder.absolute()), what)
    for path in _files(root):
        place = folder / path.relative_to(root)
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(place, path.read_bytes())


def _files(root: Path) -> Iterator[Path]:
    for pattern in PARTS:
        yield from (path for path in sorted(root.glob(pattern)) if path.is_file() and "__pycache__" not in path.parts)
