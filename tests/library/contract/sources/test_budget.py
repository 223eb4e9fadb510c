"""The house stays small enough to own: lines of each room, modules and lines of tests, as budget.toml allows.

A room above its budget may only shrink: ``today`` in budget.toml is what it has. Data of methods and systems are left
out, so that one more is no fault.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
BUDGET = tomllib.loads((ROOT / "budget.toml").read_text(encoding="utf-8"))
PACKAGES = {"library": "nearharmonic", "paper": "nearharmonic_paper", "studies": "nearharmonic_studies"}
#: Files for users, which ``nearharmonic new`` copies.
TEMPLATES = ROOT / "src/nearharmonic/commands/templates"
#: A package that holds rooms only has one line, and counts for none.
DOCSTRING = 3


#: What a file with the data of a method or a system defines.
DATA = re.compile(r"^(?:TABLEAUS?|SYSTEM) = ", re.MULTILINE)


def lines(*places: Path) -> int:
    files = [file for place in places for file in ([place] if place.is_file() else place.rglob("*.py"))]
    texts = {file: file.read_text(encoding="utf-8") for file in files}
    return sum(
        len(text.splitlines()) for file, text in texts.items() if TEMPLATES in file.parents or not DATA.search(text)
    )


def allowed(room: dict[str, int]) -> int:
    return max(room["budget"], room.get("today", 0))


def places(package: str, rooms: str) -> list[Path]:
    folder = ROOT / "src" / PACKAGES[package]
    named = [folder / room for room in rooms.split(", ")]
    return [file if (file := place.with_suffix(".py")).is_file() else place for place in named]


def modules() -> list[Path]:
    return [
        file
        for name in PACKAGES.values()
        for file in (ROOT / "src" / name).rglob("*.py")
        if TEMPLATES not in file.parents
    ]


@pytest.mark.parametrize(("package", "rooms"), [(package, rooms) for package in PACKAGES for rooms in BUDGET[package]])
def test_a_room_keeps_to_its_budget(package, rooms):
    assert lines(*places(package, rooms)) <= allowed(BUDGET[package][rooms])


def test_every_module_belongs_to_a_room_with_a_budget():
    rooms = [place for package in PACKAGES for names in BUDGET[package] for place in places(package, names)]
    left = [file for file in modules() if not any(room == file or room in file.parents for room in rooms)]
    assert all(lines(file) <= DOCSTRING for file in left), left


def test_modules_and_lines_of_tests_keep_to_their_budget():
    assert len(modules()) <= allowed(BUDGET["all"]["modules"])
    assert lines(ROOT / "tests") <= allowed(BUDGET["all"]["tests"])
