"""The page on exporting shows what the command writes."""

from __future__ import annotations

import re
from pathlib import Path

from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.export import export
from nearharmonic.integrators import integrators

PAGE = (Path(__file__).parents[3] / "docs/how_to/exchange.md").read_text(encoding="utf-8")


def test_the_page_shows_the_json_of_the_leapfrog():
    (block,) = re.findall(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)
    assert block == export(integrators["leapfrog"], "json")


def test_the_page_says_what_each_target_writes():
    (table,) = re.findall(r"^\| `--to` \|.*?\n\n", PAGE, flags=re.DOTALL | re.MULTILINE)
    named = {name for row in table.strip().splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])}
    assert named == set(TARGETS)
