"""Common parts of the benchmarks: interleaved times on one core, the option ``--repeats``, and compiled C files."""

from __future__ import annotations

import argparse
import ctypes
import subprocess
from math import inf
from pathlib import Path

from nearharmonic.numerics.clock import Patience, interleaved, pinned


def asked(page, default, option="repeats", what="interleaved repeats of each call"):
    """Value of the only option of a benchmark; the help has the first line of its docstring."""
    parser = argparse.ArgumentParser(description=page.split("\n", maxsplit=1)[0])
    parser.add_argument(f"--{option}", type=int, default=default, help=f"{what} (default {default})")
    return getattr(parser.parse_args(), option)


def shortest(calls, repeats):
    """Shortest time of each call in seconds, by its key, after a first call that compiles and loads code."""
    for call in calls.values():
        call()
    patience = Patience(least=repeats, most=repeats, seconds=inf, longest=inf)
    with pinned():
        times = interleaved(list(calls.values()), patience)
    return dict(zip(calls, map(min, times), strict=True))


def compiled(source, folder, *flags):
    """Shared library of a C file of this folder, compiled into ``folder``."""
    library = Path(folder) / f"{Path(source).stem}{len(list(Path(folder).iterdir()))}.so"
    file = Path(__file__).with_name(source)
    subprocess.run(["cc", *flags, "-shared", "-fPIC", str(file), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))
