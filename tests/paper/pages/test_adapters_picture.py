"""The picture of docs/how_to/adapters.md: the numbers of the table of the page, over those of leapfrog."""

from __future__ import annotations

import pytest

from nearharmonic_paper.pages.how_to.adapters import drawn, page, rows_of
from support.results.stated_numbers import ROOT

PLACE = ROOT / "docs/how_to/adapters.md"
TEXT = """# Methods
## Energy errors
| library | system | error in | time per force | leapfrog | babs7o7h | trained_light |
|---|---|---|---|---:|---:|---:|
| ASE | copper | meV | 4 fs | 8e-2 | 4e-4 | 2e-6 |
| scipy | pendulum | unit of H | 0.1 | 1e-3 | 5e-2 | 1e-4 |

Text with a | in it.
## ASE
| another | table |
"""


def test_marks_are_errors_over_that_of_leapfrog():
    figure = drawn(rows_of(TEXT))
    (axes,) = figure.axes
    marks = [(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if len(line.get_xdata()) == 1]
    wanted = [(1, 2), (5e-3, 2), (2.5e-5, 2), (1, 1), (50, 1), (0.1, 1)]
    assert marks == [(pytest.approx(x), y) for x, y in wanted]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["ASE: copper (4 fs)", "scipy: pendulum (0.1)"]
    low, high = axes.get_xlim()
    assert low < 2.5e-5
    assert high > 50


def test_text_of_page_stays_and_every_row_is_drawn():
    made, text = page(str(PLACE)), PLACE.read_text(encoding="utf-8")
    assert made["page"] == text
    assert len(made["figure"].axes[0].get_yticklabels()) == len(rows_of(text)) > 5
