"""Loops as numba has compiled them, for folders of compiled code that a test begins anew."""

from __future__ import annotations

import shutil

from nearharmonic.core.machine.disk import cache_folder


def keep_loops(folder):
    """Put the loops that the tests have compiled so far into an empty folder: numba takes most of the time."""
    for path in cache_folder().glob("loops-*.kernel"):
        shutil.copy2(path, folder)
