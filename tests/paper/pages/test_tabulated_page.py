"""The page on tabulated potentials: its code, its tables and its picture, against another library and a plain loop."""

from __future__ import annotations

import re
from itertools import pairwise
from math import factorial
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PPoly, make_interp_spline

import nearharmonic as nh
from nearharmonic_paper.pages.how_to import tabulated as made
from support.oracles.plain_runs import largest_error
from support.results.stated_numbers import states

PLACE = "docs/how_to/tabulated_potentials.md"
PAGE = (Path(__file__).parents[3] / PLACE).read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
Q = np.linspace(-2, 2, 401)
#: Height of the barrier of q^4/4 - q^2/2, the unit of errors.
BARRIER = 0.25


def rows(name):
    """Cells of a table between its marks."""
    part = re.search(rf"<!-- {name} -->\n(.*?)<!-- end -->", PAGE, flags=re.DOTALL)[1]
    lines = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def steps_of(method, form):
    """Largest step sizes per stage for 1e-6, 1e-8 and 1e-10 on the page, and their factors."""
    (cells,) = [row[3:] for row in rows("steps") if row[0] == f"`{method}`" and row[1] == form]
    return [(*map(float, re.findall(r"[\d.]+", cell)), 1.0)[:2] for cell in cells]


def of_scipy(degree):
    """The natural spline of another library."""
    zero = [(order, 0.0) for order in range((degree + 1) // 2, degree)]
    spline = make_interp_spline(made.Q, made.V, degree, bc_type=(zero, zero))
    return PPoly.from_spline(spline)


def defined(block):
    found = {}
    exec(compile(block, PLACE, "exec"), found)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("degree", [3, 5])
def test_spline_of_the_picture_is_that_of_another_library(degree):
    system, spline = made.splined(degree), of_scipy(degree)
    for q, v, g in zip(Q, spline(Q), spline(Q, 1), strict=True):
        # V up to 2 and slopes up to 6; both libraries solve linear systems of condition below 1e3.
        assert system.V((q,)) == pytest.approx(v, abs=2e-13)
        assert system.grad_V((q,))[0] == pytest.approx(g, abs=2e-12)


@pytest.mark.slow
def test_code_of_the_page_is_what_the_picture_shows():
    series, _, spline = map(defined, BLOCKS)
    assert float(series["well"].V((0.7,))) == float(made.fitted().V((0.7,)))
    quintic = made.splined(5)
    for q in Q[::10]:
        assert spline["V"]((q,)) == pytest.approx(quintic.V((q,)), abs=2e-13)
        assert spline["grad_V"]((q,))[0] == pytest.approx(quintic.grad_V((q,))[0], abs=2e-12)
    for name in ("q0", "p0", "t_end", "energy_scale"):
        assert str(getattr(spline["well"], name)) == str(getattr(quintic, name)) == str(getattr(series["well"], name))


@pytest.mark.slow
def test_surface_of_the_page_is_that_of_henon_and_heiles():
    surface = defined(BLOCKS[1])["surface"]
    for q in ((0.3, 0.2), (-0.7, 0.9)):
        assert surface.V(q) == pytest.approx(nh.systems["henon_heiles"].V(q), abs=1e-14)


def test_distances_of_the_fits_are_those_of_least_squares():
    """Least squares of another basis: the fitted polynomial is unique."""
    found = [(int(degree), float(table), float(exact)) for degree, table, exact in rows("degrees")]
    for degree, table, exact in found:
        fit = np.polynomial.legendre.legfit(made.Q / 2, made.V, degree)
        assert abs(np.polynomial.legendre.legval(made.Q / 2, fit) - made.V).max() == pytest.approx(table, abs=6e-6)
        distance = np.polynomial.legendre.legval(Q / 2, fit) - (Q**4 / 4 - Q**2 / 2)
        assert abs(distance).max() == pytest.approx(exact, abs=6e-6)
    rounding = 0.0005
    assert abs(made.V - (made.Q**4 / 4 - made.Q**2 / 2)).max() <= rounding
    assert states(PLACE, [rounding], "rounded to three decimals", "an error of")
    smallest = next(degree for degree, table, _ in found if table < rounding)
    assert f"Chebyshev.fit(q, table, {smallest})" in PAGE
    best = min(exact for *_, exact in found)
    assert next(degree for degree, _, exact in found if degree > smallest and exact > 4 * best) == 10
    assert "From degree 10 on" in PAGE


@pytest.mark.slow
@pytest.mark.parametrize("form", ["quintic spline", "cubic spline"])
def test_steps_of_the_page_reach_the_error_in_plain_loops(form):
    spline, method = of_scipy({"quintic spline": 5, "cubic spline": 3}[form]), nh.integrators["babps8o7h"]
    places = np.diff(spline.x) > 0
    pieces = spline.c[:, places].T.tolist()
    slopes = spline.derivative().c[:, places].T.tolist()

    def valued(several, q):
        i = min(max(int((q + 2) / 0.25), 0), 15)
        d, v = q - (-2 + 0.25 * i), 0.0
        for a in several[i]:
            v = v * d + a
        return v

    def energy(q, p):
        return p * p / 2 + valued(pieces, q)

    start = abs(energy(1.42, 0.1))
    coefficients = [[float(a) for a in row] for row in (method.kick, method.drift)]
    for bound, (step, _) in zip((1e-6, 1e-8, 1e-10), steps_of("babps8o7h", form), strict=True):
        # The step size of the grid that the page rounds to two digits, and the next one.
        (index,) = [i for i, tau in enumerate(made.STEPS) if f"{tau:.2g}" == f"{step:.2g}"][:1]
        errors = []
        for tau in made.STEPS[index : index + 2] * method.stages:
            steps = round(100 / tau)
            found = largest_error(
                (*coefficients, None), method.first, 100 / steps, steps, 1.42, 0.1, energy, lambda q: valued(slopes, q)
            )
            errors.append(found * start / BARRIER)
        assert errors[0] < bound < errors[1]


def test_factors_are_ratios_of_the_steps_of_the_page():
    for method in made.METHODS:
        best = [step for step, _ in steps_of(method, "Chebyshev series")]
        for form in ("quintic spline", "cubic spline"):
            for (step, factor), reference in zip(steps_of(method, form), best, strict=True):
                if step > made.STEPS[0]:  # both numbers have two digits
                    assert reference / step == pytest.approx(factor, rel=0.07)


def test_factors_in_the_text_are_those_of_the_table():
    text = " ".join(PAGE.split())
    *_, (_, cubic) = steps_of("babps8o7h", "cubic spline")
    assert f"At an error of 10⁻¹⁰, `babps8o7h` needs a step that is {cubic:g} times smaller with the cubic" in text
    quintic = max(factor for _, factor in steps_of("babps8o7h", "quintic spline"))
    assert f"A quintic spline costs a factor of at most {quintic:g} with" in text


def test_slopes_are_at_most_the_degree_of_the_spline():
    """Some tenths are the scatter of the errors."""
    found = {(row[0].strip("`"), row[1]): float(row[2]) for row in rows("steps")}
    for method in made.METHODS:
        for form, degree in (("quintic spline", 5), ("cubic spline", 3)):
            assert found[method, form] < degree + 0.3
    for form, slope in (("Chebyshev series", 8), ("quintic spline", 5), ("cubic spline", 3)):
        assert found["s17odr8a", form] == pytest.approx(slope, abs=0.3)


@pytest.mark.parametrize("degree", [3, 5])
def test_derivative_of_the_degree_jumps_and_lower_ones_do_not(degree):
    pieces = made.natural_spline(degree)
    step = made.Q[1] - made.Q[0]
    for before, after in pairwise(pieces):
        for order in range(degree):
            left = np.polyval(np.polyder(before, order), step) if order else np.polyval(before, step)
            assert left == pytest.approx(after[degree - order] * factorial(order), abs=1e-9)
    assert abs(np.diff(pieces[:, 0])).min() > 1e-3


def test_picture_has_curve_of_each_form_and_lines_of_slopes(monkeypatch):
    monkeypatch.setattr(made, "STEPS", np.geomspace(1e-3, 0.1, 5))
    figure = made.drawn({name: {form: made.STEPS**i for i, form in enumerate(made.LOOKS, 3)} for name in made.METHODS})
    for axes, method in zip(figure.axes, made.METHODS, strict=True):
        curves, guides = axes.lines[: len(made.LOOKS)], axes.lines[len(made.LOOKS) :]
        assert [line.get_label() for line in curves] == list(made.LOOKS)
        for line, (slope, *_), text in zip(guides, made.GUIDES[method], axes.texts, strict=True):
            x, y = np.log(line.get_xdata()), np.log(line.get_ydata())
            assert (y[1] - y[0]) / (x[1] - x[0]) == pytest.approx(slope, abs=1e-12)
            assert text.get_text() == f"slope {slope}"
