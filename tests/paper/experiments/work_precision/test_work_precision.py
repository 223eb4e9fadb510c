"""Run time against error: what is measured, tables of costs, comparisons with other libraries, and their figures."""

import dataclasses
import json
from fractions import Fraction
from itertools import combinations
from math import inf, isnan, nan

import mpmath
import numpy as np
import pytest
from matplotlib.lines import Line2D

from nearharmonic.engine.reference import position_t_end, reference
from nearharmonic.engine.settings import Sweep
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.recommendation.measure import Interval, Solver, variables
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision import WorkPrecisionSettings, figures, tables
from nearharmonic_paper.experiments.work_precision import tables as comparisons
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.experiments.work_precision.run import front_runners, intervals, solvers_on
from nearharmonic_paper.experiments.work_precision.tables import rows
from support.cubes.artists import NO_LINE, SOLID, drawn, entries, line_of, look, looks
from support.cubes.colour_vision import difference
from support.cubes.figure_cubes import FACTS, curves, label, timed


def test_chaos_gets_a_shorter_interval_for_positions_and_only_there():
    assert intervals(systems["henon_heiles"], "500") == {
        "henon_heiles": ("500", ("max", "mean")), "henon_heiles_position": ("20", ("position",)),
    }  # fmt: skip
    assert intervals(systems["henon_heiles"], "20") == {"henon_heiles": ("20", ("max", "mean", "position"))}
    assert intervals(systems["kepler"], "87660") == {"kepler": ("87660", ("max", "mean", "position"))}


def test_a_small_measurement_has_every_method_and_every_mode():
    sweep = Sweep(
        system="sho", t_end="5", lowest=0.05, highest=0.5, points_per_decade=4, precision=("double",),
        summation="compensated", samples=2, shards=1,
    )  # fmt: skip
    settings = WorkPrecisionSettings(points_per_decade=4, evaluations=200, peers=("numpy",), longest=1.0)
    here = Interval(systems["sho"], "5", reference(systems["sho"], "5"))
    ours, theirs, _ = curves(*solvers_on(here, ("max", "position"), [integrators["aba864"]], sweep, settings))
    assert ours.position_error[-1] < 1e-2
    assert all((ours[f"time_{mode}"] > 0).all() for mode in ("trajectory", "lanes", "energy"))
    assert ours.members.values.tolist() == [2048] * ours.sizes["point"]
    assert (theirs.time_trajectory.notnull() == np.isfinite(theirs.max_energy_error)).all()
    assert theirs.time_lanes.isnull().all()
    for steps, error in zip(ours.steps.values, ours.max_energy_error.values, strict=True):
        # The same method at the same step: plain numpy adds no more than rounding.
        twins = theirs.max_energy_error.values[theirs.steps.values == steps]
        assert twins == pytest.approx(np.full(twins.size, error), rel=1e-6, abs=1e-13)


def test_fractions_of_the_interval_are_compared_as_numbers():
    assert len(intervals(systems["sho"], "20.0")) == 1
    assert Fraction(position_t_end(systems["henon_heiles"], "9")) == 9
    assert mpmath.mp.dps == 60  # no computation here leaves another precision behind


#: From coarse to fine: errors, and seconds alone, in lanes and with energies. Mean errors are a tenth.
ERRORS = (1e-3, 1e-6, 1e-9)


def curve(name, seconds, errors=ERRORS, kind="splitting"):
    worst, least = np.array(errors), np.array(seconds)
    columns = {"max_energy_error": worst, "mean_energy_error": worst / 10, "evaluations": 1e6 * least}
    columns["tau"] = 0.5 / 2 ** np.arange(worst.size)
    repeats = {}
    for i, time in enumerate(seconds):
        repeats["trajectory", i] = [2 * time, time]
        repeats["lanes", i], repeats["energy", i] = [time / 4, time / 2], [3 * time, 5 * time]
    told = {"columns": columns, "times": repeats, "setup": 2e-5, "sweep": 0.25}
    return Solver(method=name, label=name.title(), kind=kind, **told)


SLOW = curve("slow", (0.001, 0.004, 0.016))
FAST = curve("fast", (0.002, 0.003, 0.005), kind="peer")
COARSE = curve("coarse", (1e-5, 1e-4, 1.5e-3), errors=(1.0, 1e-2, 1e-3))
ABSENT = Solver(method="absent", label="Absent", kind="peer", status="not installed")
SOLVERS = (SLOW, ABSENT, FAST, COARSE)
COSTS = curves(*SOLVERS)


@pytest.fixture
def found():
    return {(row["measure"], row["target"], row["method"]): row for row in rows("toy", "20", ("max", "mean"), COSTS)}


def test_row_has_costs_of_point_that_meets_its_target(found):
    row = found["max", 1e-6, "slow"]
    assert (row["system"], row["t_end"], row["label"], row["kind"], row["status"]) == (
        "toy",
        "20",
        "Slow",
        "splitting",
        "reached",
    )
    costs = (row["time_ms"], row["lanes_time_ms"], row["energy_time_ms"], row["evaluations"], row["tau"])
    # Logarithms and exponentials on the way to a point round by 1e-15.
    assert costs == pytest.approx((4.0, 1.0, 12.0, 4000.0, 0.25), rel=1e-12)
    assert isnan(row["tolerance"])


def test_row_between_two_points_lies_on_straight_line_of_logarithms(found):
    """1e-6 lies two thirds of the way from a mean of 1e-4 to one of 1e-7: 4^(2/3) times 1 ms, 2^(-2/3) times 0.5."""
    row = found["mean", 1e-6, "slow"]
    assert (row["time_ms"], row["tau"]) == pytest.approx((4 ** (2 / 3), 0.5 * 2 ** (-2 / 3)), rel=1e-12)


def test_ranks_follow_time_and_unreached_methods_have_none(found):
    ranks = {target: {m: found["max", target, m]["rank"] for m in ("slow", "fast", "coarse", "absent")}
             for target in (1e-3, 1e-6, 1e-9, 1e-12)}  # fmt: skip
    assert ranks == {
        1e-3: {"slow": 1, "coarse": 2, "fast": 3, "absent": 0},
        1e-6: {"fast": 1, "slow": 2, "coarse": 0, "absent": 0},
        1e-9: {"fast": 1, "slow": 2, "coarse": 0, "absent": 0},
        1e-12: dict.fromkeys(("fast", "slow", "coarse", "absent"), 0),
    }
    assert found["max", 1e-12, "slow"]["status"] == "not reached"
    assert found["max", 1e-3, "slow"]["status"] == "below throughout"
    assert found["max", 1e-3, "absent"]["method_status"] == "not installed"


@pytest.fixture
def page():
    return tables.markdown("toy", [("20", ("max",), COSTS)], FACTS).splitlines()


def test_page_has_times_and_evaluations_with_fastest_first(page):
    head = page.index("| method | 1e-03 ms | lanes | evaluations | 1e-06 ms | lanes | evaluations | 1e-09 ms | lanes |"
                      " evaluations | 1e-12 ms | lanes | evaluations |")  # fmt: skip
    assert page[head + 2 : head + 4] == [
        "| *Fast* | <= 2 | <= 0.5 | 2000 | 3 | 0.75 | 3000 | 5 | 1.25 | 5000 | - | - | - |",
        "| Slow | <= 1 | <= 0.25 | 1000 | 4 | 1 | 4000 | 16 | 4 | 16000 | - | - | - |",
    ]


def test_the_page_says_by_how_much_a_peer_wins(page):
    """5 ms against 16: 3.2 times as fast."""
    assert "- 1e-03: Slow, <= 1 ms" in page
    assert "- 1e-09: **a peer wins**: Fast, 5 ms, 3.2 times as fast as Slow" in page
    assert "- 1e-12: reached by none" in page
    assert "Fast 9" in "\n".join(page)


def test_page_has_least_nanoseconds_of_each_mode_and_calls_around(page):
    """A microsecond an evaluation alone, a quarter in lanes, three with the energy; 20 us a call, 250 ms a sweep."""
    assert "| Slow | 1e+03 | 250 | 3e+03 | 20 | 250 |" in page
    assert "- Absent: not installed" in page[page.index("## Missing, or ended early") :]


@pytest.mark.slow
def test_task_tells_of_one_system_what_file_has_on_it(tmp_path):
    told = {
        "sho": {"system": "sho", "t_end": "20", "measures": ["max"]},
        "near": {"system": "kepler", "t_end": "5", "measures": ["position"]},
        "far": {"system": "kepler", "t_end": "7", "measures": ["mean", "max"]},
    }
    groups = {name: variables(SOLVERS if name == "far" else [SLOW], "h") for name in told}
    store.write(tmp_path / "times.h5", {}, {**FACTS, "problems": json.dumps(told)}, groups=groups)
    made = tables.time_to_error("kepler", str(tmp_path / "times.h5"))
    lines = made["csv"].records()
    # Four targets for each measure and method: one method near, four far.
    assert [(line["t_end"], line["measure"]) for line in lines] == (
        [("5", "position")] * 4 + [("7", "mean")] * 16 + [("7", "max")] * 16
    )
    assert {line["system"] for line in lines} == {"kepler"}
    times = {(line["measure"], line["target"], line["method"]): line["time_ms"] for line in lines}
    assert (times["max", "1e-09", "fast"], times["max", "1e-09", "absent"]) == ("5", "nan")
    assert times["mean", "1e-06", "slow"] == "2.51984"  # 4^(2/3), to six digits
    assert made["md"].startswith("# Sun-Mercury system: time and evaluations to reach an error\n")
    assert made["md"].count("\n## ") == 3 + 2


#: Errors at which points lie, so that nothing is interpolated.
AT = [1e-6, 1e-9, 1e-12]


def solvers():
    found = [
        timed("ruth", AT, [1e-5, 4e-5, 9e-5], lanes=[2e-6, 3e-6, 9e-6]),
        timed("babs7o7h", AT[:2], [2e-5, 3e-5], lanes=[1e-6, 2e-6]),
        timed("leapfrog", [1e-3], [1e-6]),
        timed("rebound_ias15", AT, [7e-5, 8e-5, 5.5e-5], kind="peer"),
        timed("heyoka", AT, [5e-5, 6e-5, 6e-5], kind="peer", lanes=[4e-5, 4e-5, 4e-5]),
        Solver(method="pyhamsys_bm6", label="absent", kind="peer", status="not installed"),
    ]
    for solver in found:
        solver.columns["compensated"] = [0.0, 0.0, 1.0][: solver.settings]
    return found


def written(path, measures, **groups):
    """``path`` of a cube of systems, each with its measures or the measures of all, and its solvers."""
    problems = {name: {"system": name, "t_end": "20", "measures": measures.get(name, ["max"])} for name in groups}
    facts = {**FACTS, "libraries": "heyoka 7", "problems": json.dumps(problems)}
    store.write(path, {}, facts, groups={name: variables(found, "s") for name, found in groups.items()})
    return str(path)


@pytest.fixture
def cube(tmp_path):
    return written(tmp_path / "times.h5", {}, sho=solvers(), kepler=solvers())


def rows_of(cube, names=("sho",)):
    table = tables.comparison(names, cube)["table"]
    return [dict(zip(tables.HEADER, row, strict=True)) for row in table.rows]


@pytest.mark.slow
def test_ratios_are_those_of_least_times_of_fastest_to_standard(cube):
    one, many = rows_of(cube)[:3], rows_of(cube)[3:]
    assert [(row["compared"], row["error"], row["method"]) for row in one + many] == [
        ("one trajectory", "1e-06", label("ruth")), ("one trajectory", "1e-09", label("babs7o7h")),
        ("one trajectory", "1e-12", label("ruth")), ("ensembles", "1e-06", label("babs7o7h")),
        ("ensembles", "1e-09", label("babs7o7h")), ("ensembles", "1e-12", label("ruth")),
    ]  # fmt: skip
    assert [row["sums"] for row in one] == ["plain", "plain", "compensated"]
    # By hand, from the times above.
    assert [row["ratio"] for row in one] == pytest.approx([1 / 5, 3 / 6, 9 / 6], rel=1e-12)
    assert [row["ratio"] for row in many] == pytest.approx([1 / 40, 2 / 40, 9 / 40], rel=1e-12)
    # IAS15 is faster at 1e-12 than at 1e-9, so that its finer setting serves both.
    others = [label(name) for name in ("heyoka", "rebound_ias15", "rebound_ias15")]
    assert [row["fastest_other"] for row in one] == others
    assert [row["ratio_to_fastest_other"] for row in one] == pytest.approx([1 / 5, 3 / 5.5, 9 / 5.5], rel=1e-12)


@pytest.mark.slow
def test_medians_are_compared_with_medians(cube):
    # timed() makes three repeats of 1, 2 and 3 times the least alone, and of 1 and 2 times in lanes.
    for row in rows_of(cube):
        assert row["ratio_of_medians"] == pytest.approx(row["ratio"], rel=1e-12)


def defined(name, **changes):
    return dataclasses.replace(systems[name], **changes)


def test_regularised_system_is_compared_on_its_original_equations_too(cube, monkeypatch):
    far = {"q0": ("110", "0"), "p0": ("0", "0.04")}
    known = {
        "sho": systems["sho"], "kepler": systems["kepler"], "kepler_regularised": systems["kepler_regularised"],
        "far": defined("kepler", **far), "far_regularised": defined("kepler_regularised", **far),
    }  # fmt: skip
    monkeypatch.setattr(comparisons, "systems", known)
    measured = {
        name: curves(timed("ruth", AT, [k, k, k]), timed(peer, AT, [10 * k, 10 * k, 10 * k], kind="peer"))
        for k, (name, peer) in enumerate(
            [("far", "heyoka"), ("far_regularised", "heyoka_regularised"), ("sho", "heyoka"), ("kepler", "heyoka"),
             ("kepler_regularised", "heyoka_regularised")], start=1,
        )
    }  # fmt: skip
    monkeypatch.setattr(comparisons.engine, "read_parts", lambda _, name, __: ([("5", ("max",), measured[name])], {}))
    found = {pair.system: pair for pair in tables.pairs(cube, list(measured))[0]}
    assert [found[name].original for name in measured] == ["", "far", "", "", "kepler"]
    assert [found[name].standard(1e-9, "trajectory") for name in measured] == [10, 10, 30, 40, 40]
    assert [curve.solver for curve in found["far_regularised"].others] == ["heyoka", "heyoka_regularised"]
    assert found["far_regularised"].own_original == measured["far"][:1]
    # With another perturbation the energies differ, and so do the equations.
    known["kepler"] = defined("kepler", parameters={"GM": "1.8"})
    assert tables.pairs(cube, ["kepler", "kepler_regularised"])[0][1].original == ""


@pytest.mark.slow
def test_positions_are_compared_where_they_were_of_interest(tmp_path):
    path = written(tmp_path / "times.h5", {"sho": ["max", "position"]}, sho=solvers(), kepler=solvers())
    rows = [row for row in rows_of(path, ("sho", "kepler")) if row["measure"] == "position"]
    assert {row["system"] for row in rows} == {systems["sho"].label}
    # timed() makes position errors ten times the energy errors: 1e-9 lies between the last two points.
    one = [row for row in rows if row["compared"] == "one trajectory"]
    assert [row["error"] for row in one] == ["1e-06", "1e-09"]
    assert one[1]["ms"] == pytest.approx(1e3 * (4e-5 ** (2 / 3) * 9e-5 ** (1 / 3)), rel=1e-12)


@pytest.mark.slow
def test_regularised_figure_has_column_for_each_system_with_its_original(tmp_path):
    names = ["kepler", "kepler_regularised", "sho"]
    both = [one for one in solvers() if one.method != "heyoka"]
    both.append(timed("babps9o7h", AT, [2e-5, 3e-5, 4e-5]))
    both.append(timed("heyoka_regularised", AT, [1e-5, 1.1e-5, 1.2e-5], kind="peer"))
    path = written(
        tmp_path / "times.h5", dict.fromkeys(names, ("max", "position")),
        kepler=solvers(), kepler_regularised=both, sho=solvers(),
    )  # fmt: skip
    figure = figures.regularised_figures(names, path)["figure"]
    energy, position = figure.axes
    known = looks(figure.legends[0])
    assert list(known) == [
        "fastest method here, regularised", "BAB's9o7H, regularised", "fastest method here, original equations",
        "heyoka (adaptive Taylor), original equations", "heyoka, regularised equations",
    ]  # fmt: skip
    for axes, factor in ((energy, 1), (position, 10)):
        errors = [factor * error for error in AT]
        assert look(line_of(axes, [1e-2, 1.1e-2, 1.2e-2], errors)) == known["heyoka, regularised equations"]
        assert look(line_of(axes, [1e3 * t for t in (2e-5, 3e-5, 4e-5)], errors)) == known["BAB's9o7H, regularised"]
    assert energy.get_title(loc="left").endswith(f"{systems['kepler_regularised'].label}, $t$ = 20 h")
    figure.draw_without_rendering()


TIMES = """e,t_end,measure,curve,error,ms,ratio
0.2,87660,max,babps9o7h,1e-06,0.5,0.082
0.2,87660,max,babps9o7h,1e-12,0.7,1
0.2,87660,max,heyoka_fast_math,1e-06,2,4.6
0.2,87660,max,heyoka_fast_math,1e-12,nan,nan
0.9,87660,position,own,1e-06,3,nan
0.9,87660,position,own,1e-12,4,nan
"""


def test_times_of_a_file_are_panels_with_their_errors(tmp_path):
    (tmp_path / "times.csv").write_text(TIMES, encoding="utf-8")
    figure = figures.figure_of_file(str(tmp_path / "times.csv"))["figure"]
    known = looks(figure.legends[0])
    found = [
        {
            says: dict(zip(*line.get_data(), strict=True))
            for line in axes.get_lines()
            for says, seen in known.items()
            if seen == look(line)
        }
        for axes in figure.axes
    ]
    assert found == [
        {"BAB's9o7H, regularised": {0.5: 1e-6, 0.7: 1e-12}, "heyoka, fast_math, original equations": {2: 1e-6}},
        {"fastest method here, regularised": {3: 1e-6, 4: 1e-12}},
    ]
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == [f"Sun-Mercury orbit, e = {e}, $t$ = 87660 h" for e in ("0.2", "0.9")]


def test_curves_of_regularised_problem_are_told_apart_by_all_readers():
    found = [(*look(Line2D([], [], **drawn)), drawn.get("linewidth", 1) > 4) for _, drawn in figures.CURVES.values()]
    for (colour, *form), (other, *like) in combinations(found, 2):
        assert difference(colour, other, "deuteranopia") >= 10 or form != like


def test_ensembles_are_timed_for_methods_among_fastest_at_some_error(monkeypatch):
    monkeypatch.setattr("nearharmonic_paper.experiments.work_precision.run.FRONT", 1)
    assert front_runners(curves(*solvers()), ("max",)) == ["leapfrog", "ruth", "babs7o7h"]
    assert front_runners(curves(*solvers()[:2]), ("max",)) == ["ruth", "babs7o7h"]
    assert front_runners(curves(timed("ruth", [nan], [1.0])), ("max",)) == []


@pytest.mark.slow
def test_figures_show_winning_methods_and_every_library(cube):
    found = figures.comparison_figures(["sho", "kepler"], cube)
    shown = {"trajectory": ["ruth", "babs7o7h", "rebound_ias15", "heyoka"], "lanes": ["babs7o7h", "ruth", "heyoka"]}
    assert set(found) == set(shown)
    for mode, names in shown.items():
        assert len(found[mode].axes) == 2
        for axes in found[mode].axes:
            known = looks(axes.get_legend())
            assert list(known) == [label(name) for name in names]
            for curve in curves(*solvers()):
                if curve.solver in names:
                    line = line_of(axes, 1e3 * curve[f"time_{mode}"].values, curve.max_energy_error.values)
                    assert look(line) == known[curve.label.item()]
            assert len(axes.get_lines()) == len(names)
        (note,) = found[mode].texts
        assert "Versions: heyoka 7." in note.get_text().replace("\n", " ")


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
    return figures.work_precision_figure("toy", [("20", ("max", "mean"), toys()), ("5", ("position",), toys())], FACTS)


#: Row of panels -> its time, its y label, and its error over the error of the points.
ROWS = (
    ("20", r"$\max\,|\Delta H/H_0|$", 1),
    ("20", r"$\mathrm{mean}\,|\Delta H/H_0|$", 0.5),
    ("5", "position error", 10),
)


def panels_of(figure):
    return [figure.axes[3 * i : 3 * i + 3] for i in range(3)]


def test_rows_show_errors_over_milliseconds_and_columns_their_methods(figure):
    known = [looks(legend) for legend in figure.legends]
    for axes, (_, _, times_error) in zip(panels_of(figure), ROWS, strict=True):
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
    found = looks(figures.work_precision_figure("toy", [("20", ("max",), peers)], FACTS).legends[2])
    assert list(found) == [label(name) for name in PEERS]
    for one, other in combinations(found.values(), 2):
        assert one[0] != other[0]
        assert one[1] != other[1]


def test_pale_line_is_best_paper_method_and_dotted_one_lanes(figure):
    found = looks(figure.legends[0])
    # By hand, from RUTH and NEAR: times in ms, least error so far. Neither leapfrog nor a peer takes part.
    best = ([0.01, 0.02, 0.1, 0.2, 1.0, 2.0], [1e-3, 1e-3, 1e-4, 1e-6, 1e-6, 1e-9])
    lanes = ([0.002, 0.004, 0.02, 0.04, 0.2, 0.4], best[1])
    for axes, (_, _, times_error) in zip(panels_of(figure), ROWS, strict=True):
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
    panel = figures.work_precision_figure("toy", [("20", ("max",), lucky)], FACTS).axes[0]
    envelope = line_of(panel, [1e3 * time for time in seconds], [1e-2, 1e-2, 1e-4, 1e-6, 1e-9])
    assert look(envelope)[1] is None


def test_failed_untimed_and_meaningless_points_are_skipped():
    measured = [20.0, inf, 1e-1, nan, 1e-3, 1e-5, 1e-18]
    solver = timed("leapfrog", measured, [1e-6 * 2**i for i in range(7)])
    del solver.times["trajectory", 4]
    panel = figures.work_precision_figure("toy", [("20", ("max",), curves(solver))], FACTS).axes[1]
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
    figure = figures.work_precision_figure("toy", [("20", ("max",), absent)], FACTS)
    assert [list(entries(legend)) for legend in figure.legends if legend.get_texts()] == [
        ["Ruth ‡", "‡ no run: see the table", BEST, LANES],
        ["heyoka ‡", "IAS15 †", label("scipy_dop853"), "† not installed", "‡ no run: see the table"],
    ]
