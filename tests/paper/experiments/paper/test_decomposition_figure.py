"""Figure 2: kappa of both compositions, vanishing orders, and the legend."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic_paper.experiments.paper import figures as fig2_decomposition
from nearharmonic_paper.experiments.paper import tableaus as decompose
from support.cubes.artists import NO_LINE, SOLID, drawn, line_of, lines_of, look, look_of, ticks
from support.cubes.figure_cubes import METHODS, label, terms

#: Orders that vanish in the cube, by the row that is outermost.
VANISH = {"drift": [1, 2, 4], "kick": [1, 2, 3, 6]}
ORDERS = np.arange(1, 10)


@pytest.fixture
def cube():
    return terms()


def remaining(cube, name, first):
    """Kappa by order, NaN where it vanishes or there is none."""
    return np.where(np.isin(ORDERS, VANISH[first]), np.nan, cube.kappa.sel(integrator=name, first=first).values)


def test_kick_first_error_terms_are_lines_in_method_colour(cube):
    upper, _ = fig2_decomposition.fig2_decomposition(cube).axes
    assert (upper.get_yscale(), upper.get_ylabel()) == ("log", r"error term of the position, $\kappa_\lambda$")
    for name in METHODS:
        curve = line_of(upper, ORDERS, remaining(cube, name, "kick"))
        assert look(curve) == (look_of(name)[0], None, None, SOLID)
        np.testing.assert_array_equal(ORDERS[drawn(curve)], [4, 5, 7, 8])


def test_drift_first_error_terms_are_circles_around_markers(cube):
    upper, _ = fig2_decomposition.fig2_decomposition(cube).axes
    for name in METHODS:
        circle, inside = lines_of(upper, ORDERS, remaining(cube, name, "drift"))
        assert look(circle) == (look_of(name)[0], "o", "none", NO_LINE)
        assert look(inside) == look_of(name, NO_LINE)
        assert circle.get_markersize() > inside.get_markersize()
        np.testing.assert_array_equal(ORDERS[drawn(circle)], [3, 5, 6, 7, 8, 9])
    assert len(upper.get_lines()) == 3 * len(METHODS)


def test_vanishing_terms_are_bars_for_kick_circles_for_drift_first(cube):
    _, lower = fig2_decomposition.fig2_decomposition(cube).axes
    for row, name in enumerate(METHODS):
        bars = line_of(lower, VANISH["kick"], row)
        assert (look(bars)[0], look(bars)[1], look(bars)[3]) == (look_of(name)[0], "_", NO_LINE)
        circle, inside = lines_of(lower, VANISH["drift"], row)
        assert look(circle) == (look_of(name)[0], "o", "none", NO_LINE)
        assert look(inside) == look_of(name, NO_LINE)
    assert len(lower.get_lines()) == 3 * len(METHODS)


def test_rows_are_named_downwards_in_order_of_methods(cube):
    _, lower = fig2_decomposition.fig2_decomposition(cube).axes
    assert ticks(lower.yaxis) == {label(name): row for row, name in enumerate(METHODS)}
    heights = [lower.transData.transform((1, row))[1] for row in range(len(METHODS))]
    assert heights == sorted(heights, reverse=True)
    bottom, top = lower.get_ylim()
    assert top < 0 < len(METHODS) - 1 < bottom


def test_rounded_coefficients_of_twenty_digits_keep_the_vanishing_terms(monkeypatch):
    """Suzuki's five leapfrogs, u = 1/(4 - 4^(1/3)): order 4 on every system, and kappa_5 is no rounding error."""
    u = round(1 / (4 - Decimal(4) ** (Decimal(1) / 3)), 20)
    drift = (u, u, 1 - 4 * u, u, u)
    kick = (u / 2, u, (1 - 3 * u) / 2, (1 - 3 * u) / 2, u, u / 2)
    suzuki = nh.Tableau(
        name="suzuki", label="Suzuki", kick=tuple(map(str, kick)), drift=tuple(map(str, drift)), first="kick",
        order=4, digits=20, source="doi:10.1016/0375-9601(90)90962-N",
    )  # fmt: skip
    monkeypatch.setattr(decompose, "registry", {"suzuki": suzuki})
    kappa = decompose.decompose(["suzuki"])["cube"].kappa.sel(integrator="suzuki").values
    assert (kappa[:, :4] == 0).all()
    assert (kappa[:, 4] > 0.1).all()
