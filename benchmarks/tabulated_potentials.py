"""Energy errors with three forms of a tabulated potential, which the blocks of a page define.

Run: ``python benchmarks/tabulated_potentials.py``; ``--page`` writes tables and figure to
``docs/how_to/tabulated_potentials.md``, the page. Nothing is timed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np
from timing import ROOT, fill

from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import integrators as registered
from nearharmonic.numerics.portable import Floats
from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, write_beside
from nearharmonic.recommendation.measure import fewest_for_good
from nearharmonic_paper.pages.filling import power, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, PICTURE = "docs/how_to/tabulated_potentials.md", "tabulated_potentials.svg"
FORMS = {"Chebyshev series": "#0b3c8c", "quintic spline": "#00a070", "cubic spline": "#e86a10"}
#: Step sizes per stage, even in the logarithm, the errors for which the largest is sought, and those between which a
#: slope is fitted.
LADDER, SOUGHT, BETWEEN = np.geomspace(2e-4, 0.15, 120), (1e-6, 1e-8, 1e-10), (1e-12, 1e-6)
#: Methods, and lines of a slope in their panels: slope, and step size and error at the beginning of the line.
GUIDES = {
    "babps8o7h": ((3, 1e-3, 1e-6), (4, 0.02, 1e-12)),
    "s17odr8a": ((3, 1e-3, 1e-5), (5, 7e-4, 1e-11), (8, 0.02, 1e-12)),
}

Errors = Mapping[str, Mapping[str, Floats]]


def parts():
    """Distances of fits from a table, and energy errors with three forms of it, which the blocks of the page define."""
    series, _, spline = re.findall(r"```python\n(.*?)```", (ROOT / PAGE).read_text(encoding="utf-8"), re.DOTALL)
    codes = (series, spline, spline.replace("DEGREE = 5", "DEGREE = 3"))
    forms: dict[str, dict[str, Any]] = {form: {} for form in FORMS}
    for code, names in zip(codes, forms.values(), strict=True):
        exec(compile(code, PAGE, "exec"), names)
    found = {
        method: {
            form: sweep(names["well"], method, LADDER * registered[method].stages).max_energy_error.values
            for form, names in forms.items()
        }
        for method in GUIDES
    }
    q, energies = (forms["Chebyshev series"][name] for name in ("q", "table"))
    between, degrees = np.linspace(-2, 2, 401), []
    for degree in (2, 4, 6, 8, 10, 12):
        fit = np.polynomial.Chebyshev.fit(q, energies, degree)
        off = abs(fit(q) - energies).max(), abs(fit(between) - (between**4 / 4 - between**2 / 2)).max()
        degrees.append((degree, *(f"{x:.5f}" for x in off)))
    return {
        "degrees": table(("degree", "from the table", "from the exact energy"), degrees, left=0),
        "steps": table(("method", "form of the table", "slope", *map(power, SOUGHT)), steps_to_errors(found), left=2),
        "figure": forms_drawn(found),
    }


def steps_to_errors(found: Errors) -> Iterator[tuple[str, ...]]:
    """A row for each method and form: its slope, and the largest step sizes up to which all errors are below bounds.

    In brackets is the factor by which a step size is smaller than with the first form.
    """
    for method, several in found.items():
        best: list[float] = []
        for form, errors in several.items():
            finest_last = dict(enumerate(errors[::-1]))
            coarsest = [fewest_for_good(finest_last, bound) for bound in SOUGHT]
            sizes = [float("nan") if i is None else float(LADDER[::-1][i]) for i in coarsest]
            best = best or sizes
            cells = (
                f"below {LADDER[0]:.2g}" if isnan(size) else f"{size:.2g}" + f" ({first / size:.2g})" * (size != first)
                for size, first in zip(sizes, best, strict=True)
            )
            inside = (errors > BETWEEN[0]) & (errors < BETWEEN[1])
            slope = np.polyfit(np.log(LADDER[inside]), np.log(errors[inside]), 1)[0]
            yield f"`{method}`", form, f"{slope:.1f}", *cells


@house_style
def forms_drawn(found: Errors) -> Figure:
    """Draw the errors against the step size, a panel for each method, with lines of the expected slopes."""
    figure = new_figure(7, 3.6)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.84, bottom=0.13, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for position, (axes, (method, several)) in enumerate(zip(panels, found.items(), strict=True)):
        for form, errors in several.items():
            axes.plot(LADDER, errors, label=form, color=FORMS[form], linestyle="-")
        for slope, step, size in GUIDES[method]:
            ends = np.array([step, 3 * step])
            axes.plot(ends, size * (ends / step) ** slope, "--", color="#404040", linewidth=0.9)
            write_beside(axes, f"slope {slope}", (ends[0], size), (-4, 2), ha="right")
        panel_letter(axes, position, f"{registered[method].label}, order {registered[method].order}")
        axes.set(xlabel=r"step size per stage, $\tau/s$", ylim=(1e-16, 1))
        log_scale(axes, "xy")
    panels[0].set_ylabel(r"max $|\Delta H|$ / height of the barrier")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.54, 1), ncols=3)
    return figure


if __name__ == "__main__":
    fill(__doc__, parts, PAGE, PICTURE)
