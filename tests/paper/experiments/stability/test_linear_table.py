"""The cube and the table of linear stability: cells against closed forms and products of matrices."""

from __future__ import annotations

from itertools import pairwise
from math import acosh, inf

import numpy as np
import pytest

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic_paper.experiments.stability.reductions import linear_stability_cube, linear_stability_table

LEAPFROG = integrators["leapfrog"]
#: Two leapfrogs of half the step: with cos(phase) = 1 - tau^2/8, half the trace is cos(2 phase).
TWO = Tableau(
    name="two", label="Two leapfrogs", order=2, first="kick", kick=("0.25", "0.5", "0.25"), drift=("0.5", "0.5"),
    source="the leapfrog, twice", digits=80,
)  # fmt: skip


def half_trace(tableau, tau):
    """Half the trace of the product of shears, in doubles."""
    K = np.eye(2)
    for i, c in enumerate([c for pair in zip(tableau.outer, (*tableau.inner, "0"), strict=True) for c in pair][:-1]):
        shear = float(c) * tau
        drifts = (tableau.first == "drift") == (i % 2 == 0)
        K = np.array([[1, shear], [0, 1]] if drifts else [[1, 0], [-shear, 1]]) @ K
    return K.trace() / 2


def cells(tableau):
    table = linear_stability_table([tableau])
    return table.records()


def test_the_leapfrog_is_stable_up_to_two():
    (row,) = cells(LEAPFROG)
    growth = [row.pop(key) for key in ("largest growth per step", "at step size", "largest growth per time")]
    assert row == {
        "integrator": "leapfrog",
        "stages": 1,
        "stable from": "0",
        "stable to": "2.000000000000",
        "stable to, per stage": "2.000000000000",
        "known limit": "",
        "unstable to": "inf",
        "trace touches 2 at": "",
    }
    assert growth[:2] == [inf, inf]
    # arcosh(tau^2/2 - 1)/tau, scanned: near its maximum it is flat, so that a grid of 1e-4 is good to 1e-8.
    assert growth[2] == pytest.approx(max(acosh(t * t / 2 - 1) / t for t in np.arange(2, 8, 1e-4)), rel=1e-7)


def test_limits_are_divided_by_stages_and_touching_points_named():
    """Two leapfrogs: twice the limit, the same per stage; the trace touches -2 at phase pi/2, at tau = 2 sqrt(2)."""
    (row,) = cells(TWO)
    assert (row["stages"], row["stable to"], row["stable to, per stage"]) == (2, "4.000000000000", "2.000000000000")
    assert row["trace touches 2 at"] == "2.828427124746"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aba864", pytest.param("babps9o7h", marks=pytest.mark.slow)])
def test_each_interval_of_stability_ends_at_gap_with_its_growth(name):
    tableau, rows = integrators[name], cells(integrators[name])
    assert len(rows) > 1
    assert (rows[0]["stable from"], rows[-1]["unstable to"]) == ("0", "inf")
    for row, following in pairwise(rows):
        start, end = float(row["stable to"]), float(row["unstable to"])
        assert float(row["stable from"]) < start < end == float(following["stable from"])
        assert float(row["stable to, per stage"]) == pytest.approx(start / tableau.stages, rel=1e-11)
        scan = np.linspace(start, end, 2001)[1:-1]
        growth = np.arccosh(np.maximum(1, [abs(half_trace(tableau, tau)) for tau in scan]))
        # A parabola about its top: the grid misses it by (1/2000)^2, and traces near 2 keep half of 1e-16's digits.
        assert row["largest growth per step"] == pytest.approx(growth.max(), rel=1e-5)
        assert row["largest growth per time"] == pytest.approx((growth / scan).max(), rel=1e-5)
        assert row["at step size"] == pytest.approx(scan[growth.argmax()], abs=2e-3 * (end - start))
    assert sum(row["known limit"] != "" for row in rows) == 1
    assert rows[0]["stable to"].startswith(rows[0]["known limit"][:9])


def test_cube_has_half_trace_over_step_size_per_stage():
    tableaus = [LEAPFROG, TWO, integrators["babps9o7h"]]
    cube = linear_stability_cube(tableaus)
    tau = cube.tau_per_stage.values
    assert (tau[0], tau[-1], len(tau)) == (0, 2.4, 961)
    np.testing.assert_allclose(cube.half_trace.sel(integrator="leapfrog"), 1 - tau**2 / 2, atol=1e-14)
    np.testing.assert_allclose(cube.half_trace.sel(integrator="two"), 2 * (1 - tau**2 / 2) ** 2 - 1, atol=1e-13)
    # The polynomial's terms reach 1e3 before they cancel.
    expected = [half_trace(tableaus[2], 9 * t) for t in tau]
    np.testing.assert_allclose(cube.half_trace.sel(integrator="babps9o7h"), expected, atol=1e-9, rtol=1e-9)
    assert cube.stages.values.tolist() == [1, 2, 9]


def test_cube_has_gaps_of_table_and_nothing_past_last():
    tableaus = [LEAPFROG, integrators["babps9o7h"]]
    cube = linear_stability_cube(tableaus)
    for tableau in tableaus:
        one, rows = cube.sel(integrator=tableau.name), cells(tableau)
        for variable, column in (
            ("start", "stable to"), ("end", "unstable to"), ("growth_per_step", "largest growth per step"),
            ("growth_per_time", "largest growth per time"),
        ):  # fmt: skip
            values = one[variable].values
            assert values[: len(rows)] == pytest.approx([float(row[column]) for row in rows], rel=1e-11)
            assert np.isnan(values[len(rows) :]).all()
    assert np.isnan(cube.start.values).any()
