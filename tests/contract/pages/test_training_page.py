"""The page on how trained methods were found says what is proved of the registered ones."""

from __future__ import annotations

from pathlib import Path

from nearharmonic.output.page import filled
from nearharmonic.registry.user_module import load

ROOT = Path(__file__).parents[3]


def test_tables_of_page_are_those_of_registered_methods():
    made = load(ROOT / "benchmarks/training_page.py", "the page", ValueError)
    page = (ROOT / "docs/training.md").read_text(encoding="utf-8")
    parts = made.parts()
    assert all(text.count("\n|") > 2 for text in parts.values())
    assert set(parts) == {"methods", "shifted"}
    assert filled(page, parts) == page
