"""Work-precision diagrams: points of each curve, best method at each time, and missing curves."""

from __future__ import annotations

from itertools import combinations
from math import inf, nan

import numpy as np
import pytest

from nearharmonic.recommendation.measure import Solver
from nearharmonic_paper.experiments.work_precision.figures import work_precision_figure
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from support.cubes.artists import NO_LINE, SOLID, drawn, entries, line_of, look, looks
from support.cubes.figure_cubes import FACTS, curves, label, timed

#: Best times in s and errors: the first of the paper's methods leads at first, the second in the end.
RUTH = ([1e-5, 1e-4, 1e-3], [1e-3, 1e-4, 1e-5])
NEAR = ([2e-5, 2e-4, 2e-3], [1e-2, 1e-6, 1e-9])
BEST, LANES = "best of these", "the same, each of an ensemble"


def toys():
    return curves(
        timed("ruth", RUTH[1], RUTH[0], lanes=[2e-6, 2e-5, 2e-4]),
        timed("babs7o7h", NEAR[1], NEAR[0], lanes=[4e-6, 4e-5, 4e-4]),
        timed("leapfrog", [3e-2, 3e-4, 3e-6], [3e-6, 3e-5, 3e-4], lanes=[1e-7, 1e-6, 1e-5]),
        timed("heyoka", [1e-4, 1e-13], [5e-5, 6e-5], kind="peer"),
        timed("rebound_ias15", [1e-5, 1e-12], [7e-5, 8e-5], kind="peer"),
    )


@pytest.fixture(scope="module")
def figure():
    return work_precision_figure("toy", [("20", ("max", "mean"), toys()), ("5", ("position",), toys())], FACTS)


#: Row of panels -> its time, its y label, and its error over that of the points.
ROWS = (
    ("20", r"$\max\,|\Delta H/H_0|$", 1),
    ("20", r"$\mathrm{mean}\,|\Delta H/H_0|$", 0.5),
    ("5", "position error", 10),
)


def rows_of(figure):
    return [figure.axes[3 * i : 3 * i + 3] for i in range(3)]


def test_rows_show_errors_over_milliseconds_and_columns_their_methods(figure):
    known = [looks(legend) for legend in figure.legends]
    for axes, (_, _, times_error) in zip(rows_of(figure), ROWS, strict=True):
        for column, members in enumerate((toys()[:2], toys()[2:3], toys()[3:])):
            for curve in members:
                x, y = 1e3 * curve.time_trajectory.values, times_error * curve.max_energy_error.values
                line = line_of(axes[column], x, y)
                assert look(line) == known[column][curve.label.item()]
                assert drawn(line).all()
            # Two envelopes in every panel, nothing else.
            assert len(axes[column].get_lines()) == len(members) + 2


def test_no_two_peers_look_alike():
    peers = curves(*(timed(name, [1e-3], [1e-3], kind="peer") for name in PEERS))
    found = looks(work_precision_figure("toy", [("20", ("max",), peers)], FACTS).legends[2])
    assert list(found) == [label(name) for name in PEERS]
    for one, other in combinations(found.values(), 2):
        assert one[0] != other[0]
        assert one[1] != other[1]


def test_pale_line_is_best_paper_method_and_dotted_one_lanes(figure):
    found = looks(figure.legends[0])
    # By hand, from RUTH and NEAR: times in ms, least error so far. Neither leapfrog nor a peer takes part.
    best = ([0.01, 0.02, 0.1, 0.2, 1.0, 2.0], [1e-3, 1e-3, 1e-4, 1e-6, 1e-6, 1e-9])
    lanes = ([0.002, 0.004, 0.02, 0.04, 0.2, 0.4], best[1])
    for axes, (_, _, times_error) in zip(rows_of(figure), ROWS, strict=True):
        for panel in axes:
            envelopes = [line for line in panel.get_lines() if line.get_marker() in ("None", "none")]
            for line, (x, y), text in zip(envelopes, (best, lanes), (BEST, LANES), strict=True):
                np.testing.assert_allclose(line.get_xdata(), x, rtol=1e-12)
                np.testing.assert_allclose(line.get_ydata(), np.multiply(y, times_error), rtol=1e-12)
                assert look(line) == found[text]
    assert found[BEST][3] == SOLID
    assert found[LANES][3] not in (SOLID, NO_LINE)


def test_error_that_finer_steps_contradict_is_not_best():
    seconds = [1e-5, 2e-5, 4e-5, 8e-5, 16e-5]
    lucky = curves(timed("ruth", [1e-9, 1e-2, 1e-4, 1e-6, 1e-9], seconds))
    panel = work_precision_figure("toy", [("20", ("max",), lucky)], FACTS).axes[0]
    envelope = line_of(panel, [1e3 * time for time in seconds], [1e-2, 1e-2, 1e-4, 1e-6, 1e-9])
    assert look(envelope)[1] is None


def test_failed_untimed_and_meaningless_points_are_skipped():
    measured = [20.0, inf, 1e-1, nan, 1e-3, 1e-5, 1e-18]
    solver = timed("leapfrog", measured, [1e-6 * 2**i for i in range(7)])
    del solver.times["trajectory", 4]
    panel = work_precision_figure("toy", [("20", ("max",), curves(solver))], FACTS).axes[1]
    (line,) = panel.get_lines()
    np.testing.assert_allclose(line.get_xdata(), [4e-3, 32e-3], rtol=1e-12)
    assert list(line.get_ydata()) == [1e-1, 1e-5]


def test_a_curve_without_points_bears_the_mark_of_its_reason():
    absent = curves(
        Solver(method="ruth", label="Ruth", kind="splitting", status="does not fit"),
        Solver(method="heyoka", label="heyoka", kind="peer"),
        Solver(method="rebound_ias15", label="IAS15", kind="peer", status="not installed"),
        timed("scipy_dop853", [1e-3], [1e-3], kind="peer"),
    )
    figure = work_precision_figure("toy", [("20", ("max",), absent)], FACTS)
    assert [list(entries(legend)) for legend in figure.legends if legend.get_texts()] == [
        ["Ruth ‡", "‡ no run: see the table", BEST, LANES],
        ["heyoka ‡", "IAS15 †", label("scipy_dop853"), "† not installed", "‡ no run: see the table"],
    ]
