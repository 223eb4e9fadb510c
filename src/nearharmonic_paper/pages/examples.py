"""The tables and the figure of docs/results/examples.md: errors of all methods on the examples, by anharmonicity."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.integrators import integrators as registered
from nearharmonic.output.page import filled_page
from nearharmonic.plotting.style import house_style, new_figure, panel_letter
from nearharmonic_paper.pages.anharmonicity import (
    COSTS,
    NEW,
    SIX,
    Result,
    examples_in,
    families,
    measured,
    orbits_of,
    others,
)
from nearharmonic_paper.pages.trained import signed, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Bands of delta in the first table.
BANDS = (0, 0.01, 0.1, 0.5, 1.01)
#: Markers and colours of the families in the figure.
LOOKS = tuple(zip("osD^vP", ("#0b3c8c", "#e86a10", "#00a070", "#8e3fb5", "#8b0000", "#4a90e2"), strict=True))


def page(page: str, files: Sequence[str], systems: Sequence[str], integrators: Sequence[str]) -> dict[str, Any]:
    """Fill the page, and draw its figure. ``files`` are paths of the examples."""
    found, results = tables(files)
    return {"page": filled_page(page, found), "figure": drawn(results)}


def table_of_examples(results: Sequence[Result]) -> str:
    """Return a row for each example and cost."""
    header = ("example", "forces", "δ", "best of the ten", "error", "best of other authors", "error",
              "gain over the six", "gain over all")  # fmt: skip
    rows = []
    for result in sorted(results, key=lambda one: one.delta):
        for cost in COSTS:
            ten, other = (result.best(cost, names) for names in (NEW + SIX, others()))
            named = [text for name in (ten, other) for text in (registered[name].label, result.shown(cost, name))]
            first = cost == COSTS[0]
            file = f"[{result.orbit.family}](../../examples/{result.orbit.family}.py)" if first else ""
            gains = [signed(result.gain(cost, names), 1) for names in (SIX, others())]
            rows.append((file, cost, f"{result.delta:.2g}" if first else "", *named, *gains))
    return table(header, rows, left=2)


def table_of_families(results: Sequence[Result]) -> str:
    """Return a row for each orbit of the families."""
    header = ("orbit", "amplitude", "δ", *(f"over the six, {cost}" for cost in COSTS),
              *(f"over all, {cost}" for cost in COSTS))  # fmt: skip
    rows = []
    for i, result in enumerate(results):
        new = i == 0 or results[i - 1].orbit.family != result.orbit.family
        gains = [signed(result.gain(cost, names), 1) for names in (SIX, others()) for cost in COSTS]
        rows.append((result.orbit.family if new else "", result.orbit.amplitude, f"{result.delta:.2g}", *gains))
    return table(header, rows, left=2)


def table_of_bands(results: Sequence[Result]) -> str:
    """Return the smallest, median and largest gain of the orbits whose delta is in a band."""
    header = ("δ", "compared with", *(f"{cost} forces" for cost in COSTS))
    rows = []
    for low, high in pairwise(BANDS):
        inside = [one for one in results if low <= one.delta < high]
        for names, says in ((SIX, "the other six"), (others(), "all others")):
            cells = []
            for cost in COSTS:
                gains = [gain for one in inside if not isnan(gain := one.gain(cost, names))]
                low_gain, middle, high_gain = (signed(float(f(gains)), 1) for f in (min, np.median, max))
                cells.append(f"{low_gain} / **{middle}** / {high_gain}")
            rows.append((f"{low:g} to {high:g} ({len(inside)} orbits)" if names is SIX else "", says, *cells))
    return table(header, rows, left=2)


@house_style
def drawn(results: Sequence[Result]) -> Figure:
    """Gain against delta at the middle cost, a marker for each family, the other examples as crosses."""
    from matplotlib.lines import Line2D

    figure = new_figure(7, 6.4)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.88, bottom=0.08, hspace=0.15)
    panels = figure.subplots(2, 1, sharex=True)
    looks = iter(LOOKS)
    seen: dict[str, dict[str, Any]] = {}
    for result in results:
        family = result.orbit.family if result.orbit.amplitude else "other examples"
        if family not in seen:
            marker, colour = next(looks) if result.orbit.amplitude else ("x", "#595959")
            seen[family] = {"marker": marker, "color": colour, "linestyle": "none"}
        for axes, names in zip(panels, (SIX, others()), strict=True):
            axes.plot(result.delta, result.gain(COSTS[1], names), **seen[family])
    compared = ("the other six of the paper", "all methods of other authors")
    for axes, letter, says in zip(panels, "AB", compared, strict=True):
        axes.axhline(0, color="#404040", linewidth=0.8)
        axes.set(xscale="log", xlim=(1e-4, 1.3), ylabel="gain (decades)")
        panel_letter(axes, letter, f"over {says}, {COSTS[1]} forces in the shortest period")
    panels[1].set_xlabel(r"variation of the Hessian along the orbit, $\delta$")
    handles = [Line2D([], [], label=family, **look) for family, look in seen.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.54, 1), ncols=4)
    return figure


def tables(files: Sequence[str]) -> tuple[dict[str, str], list[Result]]:
    """Return the text between the marks of the page, and every result."""
    examples = examples_in(files)
    of_examples = [measured(orbit) for orbit in orbits_of(examples)]
    of_families = [measured(orbit) for orbit in families(examples)]
    twice = {one.orbit.system.name for one in of_families}
    rest = [one for one in of_examples if one.orbit.system.name not in twice]
    results = [*of_families, *rest]
    parts = {"bands": table_of_bands(results), "examples": table_of_examples(of_examples)}
    return parts | {"families": table_of_families(of_families)}, results
