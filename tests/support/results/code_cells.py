"""Code cells of pages, executed as a build of the site executes them."""

from __future__ import annotations

import re

from support.results.stated_numbers import ROOT


def executed(page):
    """The names that the code cells of a page define."""
    cells = re.findall(
        r"```\{code-cell\} i?python3\n(?:---\n.*?\n---\n)?(?::tags:[^\n]*\n)?(.*?)```",
        (ROOT / page).read_text("utf-8"), re.DOTALL,
    )  # fmt: skip
    assert cells
    names = {}
    for i, cell in enumerate(cells):
        exec(compile(cell, f"{page}, cell {i}", "exec"), names)
    return names
