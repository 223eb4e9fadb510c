"""The figure of docs/how_to/adapters.md: energy errors inside other libraries, from the table of the page.

Libraries state errors in their own units. The figure shows them over that of leapfrog at the same number of forces.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, style_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Heading of the table, its columns before the errors, and the methods in the order of the columns of errors.
HEADING, BEFORE = "## Energy errors", 4
METHODS = {"leapfrog": "Leapfrog", "babs7o7h": "BABs7o7H", "trained_light": "trained light"}


def page(page: str) -> dict[str, Any]:
    """Draw the figure of the page, whose text stays."""
    text = Path(page).read_text(encoding="utf-8")
    return {"page": text, "figure": drawn(rows_of(text))}


def rows_of(text: str) -> list[list[str]]:
    """Return the cells of the rows of the table of errors."""
    _, _, below = text.partition(f"\n{HEADING}\n")
    lines = re.findall(r"^\|(.*)\|$", below.partition("\n## ")[0], re.MULTILINE)
    return [[cell.strip() for cell in line.split("|")] for line in lines[2:]]


@house_style
def drawn(rows: Sequence[Sequence[str]]) -> Figure:
    """Draw the errors over that of leapfrog: a line for each row of the table, and a mark for each method."""
    figure = new_figure(7, 0.36 * len(rows) + 1.2)
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.5, right=0.98, top=1 - 0.4 / height, bottom=0.55 / height)
    axes = figure.subplots()
    places = range(len(rows), 0, -1)
    for place, row in zip(places, rows, strict=True):
        errors = [float(cell) for cell in row[BEFORE:]]
        axes.plot(
            [min(errors) / errors[0], max(errors) / errors[0]], [place, place], color="#c8c8c8", linewidth=1, zorder=1
        )
        for name, error in zip(METHODS, errors, strict=True):
            axes.plot(error / errors[0], place, **style_of(name).line(markersize=6, linestyle="none"))
    axes.set_yticks(list(places), [f"{row[0]}: {row[1]} ({row[3]})" for row in rows])
    axes.set(xlabel="energy error over that of leapfrog", ylim=(0.3, len(rows) + 0.7))
    axes.tick_params(axis="y", which="both", length=0)
    log_scale(axes, "x")
    figure.legend(handles=method_handles(METHODS, METHODS.values()), loc="upper right", ncols=3)
    return figure
