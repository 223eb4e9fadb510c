"""Progress of a long run: on a terminal, and nowhere else."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from contextlib import suppress
from pathlib import Path

import pytest

import nearharmonic as nh

LONG = """
import nearharmonic as nh
from nearharmonic.engine import batch
nh.sweep("sho", "ruth", [1.0])
batch.LONG = 0.1
nh.integrate("sho", "ruth", 1e-5, t_end=200)
"""


def run(stderr):
    environment = {**os.environ, "PYTHONPATH": str(Path(nh.__file__).parents[1])}
    return subprocess.run(
        [sys.executable, "-c", LONG], stderr=stderr, stdin=subprocess.DEVNULL, env=environment, check=True
    )


@pytest.mark.slow
def test_a_long_run_shows_its_progress_on_a_terminal():
    """A terminal of 24 by 80; the bar counts steps, and is wiped off at the end."""
    reader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    run(terminal)
    os.close(terminal)
    shown = b""
    with suppress(OSError):  # the end of a terminal
        while chunk := os.read(reader, 65536):
            shown += chunk
    os.close(reader)
    assert b"20.0M" in shown
    assert b"steps/s" in shown
    assert shown.endswith(b" \r")


@pytest.mark.slow
def test_nothing_is_written_where_there_is_no_terminal():
    assert run(subprocess.PIPE).stderr == b""
