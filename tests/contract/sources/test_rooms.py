"""Rooms are not full: what comes next is nested in one of them, or has a room of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3] / "src/nearharmonic"
#: Folders of data files, one for each source, and the most things side by side in the others.
DATA = {"integrators", "systems"}
MOST, IN_CORE, AT_THE_TOP = 9, 12, 18
LONGEST = 300
ROOMS = [path for path in ROOT.rglob("*") if path.is_dir() and path.name != "__pycache__"]


def things_in(room):
    """Modules, rooms and other files; what Python leaves of a room that is gone counts nothing."""
    names = {"__init__.py", "__pycache__", "py.typed"}
    return sorted(
        path.name
        for path in room.iterdir()
        if path.name not in names and (path.is_file() or any(one.suffix != ".pyc" for one in path.rglob("*.*")))
    )


def test_the_top_and_the_core_are_not_full():
    assert len(things_in(ROOT)) <= AT_THE_TOP
    assert len(things_in(ROOT / "core")) <= IN_CORE


@pytest.mark.parametrize("room", sorted(str(path.relative_to(ROOT)) for path in ROOMS))
def test_a_room_has_few_things(room):
    if room not in DATA | {"core"}:
        assert len(things_in(ROOT / room)) <= MOST, things_in(ROOT / room)
