"""Files that each job of a project opens: a hook that Python loads at the start of every process there."""

from __future__ import annotations

import os
import re
from pathlib import Path

#: Module that Python imports by its name, if it is on the path.
HOOK = """
import os, sys

def note_files():
    os.makedirs("opened", exist_ok=True)
    # A file descriptor has flags and no mode.
    mode = lambda told: told[1] or ("w" if told[2] & (os.O_WRONLY | os.O_RDWR) else "rb")
    note = lambda event, told: event == "open" and os.write(place, f"{mode(told)} {told[0]}\\n".encode())
    place = os.open(f"opened/{os.getpid()}", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    sys.addaudithook(note)

if any("nearharmonic_forkserver" in word for word in sys.orig_argv):
    os.register_at_fork(after_in_child=note_files)  # each fork is a job
elif any(".snakemake/scripts" in word for word in sys.orig_argv):
    note_files()
"""
LOG = re.compile(r"^w (results/.*/logs/.*\.log)$", re.MULTILINE)
READ = re.compile(r"^rb? (.*)$", re.MULTILINE)


def follow(source: Path) -> None:
    """Let jobs whose Python path begins with ``source`` note what they open."""
    (source / "sitecustomize.py").write_text(HOOK)


def read_by_jobs(folder: Path) -> dict[str, set[str]]:
    """Log of each job that ran in ``folder`` -> the files that the job read, as paths from there."""
    told = [path.read_text().replace(f"{folder}{os.sep}", "") for path in (folder / "opened").iterdir()]
    return {LOG.findall(text)[0]: set(READ.findall(text)) for text in told}
