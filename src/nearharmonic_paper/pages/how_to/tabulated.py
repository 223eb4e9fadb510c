"""The tables and the figure of docs/how_to/tabulated_potentials.md: energy errors with three forms of one table.

The table is that of examples/tabulated_well.py. The forms are a series of Chebyshev polynomials that is fitted to it,
and natural splines of degree five and three through all of its points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from math import comb, log
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import integrators as registered
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, write_beside
from nearharmonic.recommendation.step_search import fewest_for_good
from nearharmonic.systems import System

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The points, and the rounded energies.
Q = np.linspace(-2, 2, 17)
V = np.round(Q**4 / 4 - Q**2 / 2, 3)
DEGREE, DEGREES = 4, (2, 4, 6, 8, 10, 12)
#: Start and interval, those of the example; the height of the barrier is the unit of energy errors.
START: dict[str, Any] = {"q0": "1.42", "p0": "0.1", "t_end": "100", "energy_scale": "0.25"}
METHODS = ("babps8o7h", "s17odr8a")
#: Step sizes per stage, even in the logarithm, and the errors for which the largest is sought.
STEPS = np.geomspace(2e-4, 0.15, 120)
ERRORS = (1e-6, 1e-8, 1e-10)
#: Errors between which a slope is fitted.
BETWEEN = (1e-12, 1e-6)
#: Labels and looks of the forms in the figure.
LOOKS = {
    "Chebyshev series": {"color": "#0b3c8c", "linestyle": "-"},
    "quintic spline": {"color": "#00a070", "linestyle": "-"},
    "cubic spline": {"color": "#e86a10", "linestyle": "-"},
}
#: Lines of a slope in the panel of a method: slope, and step size and error at the beginning of the line.
GUIDES = {
    "babps8o7h": ((3, 1e-3, 1e-6), (4, 0.02, 1e-12)),
    "s17odr8a": ((3, 1e-3, 1e-5), (5, 7e-4, 1e-11), (8, 0.02, 1e-12)),
}
_POWERS = "⁰¹²³⁴⁵⁶⁷⁸⁹"

Errors = Mapping[str, Mapping[str, Floats]]


def page(page: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, Any]:
    """Fill the page, and draw its figure."""
    found = errors()
    parts = {"degrees": degrees_table(), "steps": steps_table(found)}
    filled = {name: "\n".join(["", *lines, ""]) for name, lines in parts.items()}
    return {"page": filled_page(page, filled), "figure": drawn(found)}


def natural_spline(degree: int) -> Floats:
    """Return the coefficients of the natural spline of odd degree through the table, a row for each interval.

    A row has the coefficients of the powers of q - Q[i], the highest first. At both ends, the derivatives of the order
    (degree + 1)/2 up to degree - 1 are zero.
    """
    pieces, step, width = Q.size - 1, float(Q[1] - Q[0]), degree + 1

    def derivative(order: int, at: float) -> Floats:
        """Factors of the coefficients of a piece, from the constant up, in a derivative over its factorial."""
        powers = [comb(power, order) * at ** (power - order) if power >= order else 0.0 for power in range(width)]
        return np.array(powers)

    rows, values = [], []

    def equation(value: float, parts: Mapping[int, Floats]) -> None:
        row = np.zeros(pieces * width)
        for piece, factors in parts.items():
            row[piece * width : (piece + 1) * width] = factors
        rows.append(row)
        values.append(value)

    for piece in range(pieces):
        equation(V[piece], {piece: derivative(0, 0.0)})
        equation(V[piece + 1], {piece: derivative(0, step)})
    for piece in range(pieces - 1):
        for order in range(1, degree):
            equation(0.0, {piece: derivative(order, step), piece + 1: -derivative(order, 0.0)})
    for order in range((degree + 1) // 2, degree):
        equation(0.0, {0: derivative(order, 0.0)})
        equation(0.0, {pieces - 1: derivative(order, step)})
    solved = np.linalg.solve(np.array(rows), np.array(values))
    return np.ascontiguousarray(solved.reshape(pieces, width)[:, ::-1])


def fitted() -> System:
    """Return the system of the series of Chebyshev polynomials."""
    series = np.polynomial.Chebyshev.fit(Q, V, DEGREE)
    return System(name="chebyshev_series", V=lambda q: series(q[0]), **START)


def splined(degree: int) -> System:
    """Return the system of the natural spline of a degree; beyond the table, its outermost pieces continue."""
    import numba

    coefficients, first, step, last = natural_spline(degree), float(Q[0]), float(Q[1] - Q[0]), Q.size - 2

    @numba.njit
    def piece(x):  # type: ignore[no-untyped-def]
        i = min(max(int((x - first) / step), 0), last)
        return i, x - (first + step * i)

    @numba.njit
    def energy(q):  # type: ignore[no-untyped-def]
        i, d = piece(q[0])
        v = 0.0
        for a in coefficients[i]:
            v = v * d + a
        return v

    @numba.njit
    def gradient(q):  # type: ignore[no-untyped-def]
        i, d = piece(q[0])
        v = g = 0.0
        for a in coefficients[i]:
            g = g * d + v
            v = v * d + a
        return (g,)

    return System(name=f"spline_{degree}", V=energy, grad_V=gradient, **START)


@cache
def forms() -> dict[str, System]:
    """Return the systems by the labels of their forms."""
    return dict(zip(LOOKS, (fitted(), splined(5), splined(3)), strict=True))


def errors() -> dict[str, dict[str, Floats]]:
    """Return max |dH| over the height of the barrier at each of the :data:`STEPS`, by method and form."""
    return {
        method: {
            label: sweep(system, method, STEPS * registered[method].stages).max_energy_error.values
            for label, system in forms().items()
        }
        for method in METHODS
    }


def largest_step(found: Floats, bound: float) -> float:
    """Return the largest step size per stage up to which all errors are below ``bound``; NaN if none is."""
    coarsest = fewest_for_good(dict(zip(1 / STEPS, found, strict=True)), bound)
    return float("nan") if coarsest is None else 1 / coarsest


def slope(found: Floats) -> float:
    """Return the slope of log error against log step size between the errors :data:`BETWEEN`."""
    inside = (found > BETWEEN[0]) & (found < BETWEEN[1])
    return float(np.polyfit(np.log(STEPS[inside]), np.log(found[inside]), 1)[0])


def degrees_table() -> list[str]:
    """Return a row for each degree: largest distances from the table, and between its points from the exact energy."""
    between = np.linspace(-2, 2, 401)
    exact = between**4 / 4 - between**2 / 2
    rows = []
    for degree in DEGREES:
        series = np.polynomial.Chebyshev.fit(Q, V, degree)
        rows.append([degree, f"{abs(series(Q) - V).max():.5f}", f"{abs(series(between) - exact).max():.5f}"])
    return pipes(["degree", "from the table", "from the exact energy"], rows, align="r")


def steps_table(found: Errors) -> list[str]:
    """Return a row for each method and form: its slope, and the largest step sizes for the bounds of the error."""
    rows = []
    for method, several in found.items():
        best = [largest_step(several["Chebyshev series"], bound) for bound in ERRORS]
        for label, one in several.items():
            sizes = [largest_step(one, bound) for bound in ERRORS]
            cells = [_cell(size, reference) for size, reference in zip(sizes, best, strict=True)]
            rows.append([f"`{method}`", label, f"{slope(one):.1f}", *cells])
    heads = [f"10⁻{''.join(_POWERS[int(digit)] for digit in str(round(-log(bound, 10))))}" for bound in ERRORS]
    return pipes(["method", "form of the table", "slope", *heads], rows, align="llr")


def _cell(size: float, reference: float) -> str:
    """Return a step size, and the factor by which it is smaller than the reference."""
    if np.isnan(size):
        return f"below {STEPS[0]:.2g}"
    return f"{size:.2g} ({reference / size:.2g})" if size != reference else f"{size:.2g}"


@house_style
def drawn(found: Errors) -> Figure:
    """Draw the errors against the step size, a panel for each method, with lines of the expected slopes."""
    figure = new_figure(7, 3.6)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.84, bottom=0.13, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for position, (axes, (method, several)) in enumerate(zip(panels, found.items(), strict=True)):
        for label, one in several.items():
            axes.plot(STEPS, one, label=label, **LOOKS[label])
        for power, step, size in GUIDES[method]:
            ends = np.array([step, 3 * step])
            axes.plot(ends, size * (ends / step) ** power, "--", color="#404040", linewidth=0.9)
            write_beside(axes, f"slope {power}", (ends[0], size), (-4, 2), ha="right")
        panel_letter(axes, position, f"{registered[method].label}, order {registered[method].order}")
        axes.set(xlabel=r"step size per stage, $\tau/s$", ylim=(1e-16, 1))
        log_scale(axes, "xy")
    panels[0].set_ylabel(r"max $|\Delta H|$ / height of the barrier")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.54, 1), ncols=3)
    return figure
