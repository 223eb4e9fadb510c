"""Comparison with other libraries: ratios of times at equal error, and their figures."""

from __future__ import annotations

import dataclasses
import json
from itertools import combinations
from math import nan
from pathlib import Path

import pytest
from matplotlib.lines import Line2D

from nearharmonic.output import store
from nearharmonic.recommendation.measure import Solver, variables
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision import tables as comparisons
from nearharmonic_paper.experiments.work_precision.figures import (
    CURVES,
    comparison_figures,
    figure_of_file,
    regularised_figures,
)
from nearharmonic_paper.experiments.work_precision.run import front_runners
from nearharmonic_paper.experiments.work_precision.tables import HEADER, comparison, pairs
from support.cubes.artists import line_of, look, looks
from support.cubes.colour_vision import difference
from support.cubes.figure_cubes import FACTS, curves, label, timed

#: Errors at which points lie, so that nothing is interpolated.
AT = [1e-6, 1e-9, 1e-12]


def solvers():
    found = [
        timed("ruth", AT, [1e-5, 4e-5, 9e-5], lanes=[2e-6, 3e-6, 9e-6]),
        timed("babs7o7h", AT[:2], [2e-5, 3e-5], lanes=[1e-6, 2e-6]),
        timed("leapfrog", [1e-3], [1e-6]),
        timed("heyoka", AT, [5e-5, 6e-5, 6e-5], kind="peer", lanes=[4e-5, 4e-5, 4e-5]),
        timed("rebound_ias15", AT, [7e-5, 8e-5, 5.5e-5], kind="peer"),
        Solver(method="pyhamsys_bm6", label="absent", kind="peer", status="not installed"),
    ]
    for solver in found:
        solver.columns["compensated"] = [0.0, 0.0, 1.0][: solver.settings]
    return found


def written(path, measures, **groups):
    """``path`` of a cube of systems, each with its measures or those of all, and its solvers."""
    problems = {name: {"system": name, "t_end": "20", "measures": measures.get(name, ["max"])} for name in groups}
    facts = {**FACTS, "libraries": "heyoka 7", "problems": json.dumps(problems)}
    store.write(path, {}, facts, groups={name: variables(found, "s") for name, found in groups.items()})
    return str(path)


@pytest.fixture
def cube(tmp_path):
    return written(tmp_path / "times.h5", {}, sho=solvers(), kepler=solvers())


def rows_of(cube, names=("sho",)):
    table = comparison(names, cube)["table"]
    return [dict(zip(HEADER, row, strict=True)) for row in table.rows]


@pytest.mark.slow
def test_ratios_are_those_of_least_times_of_fastest_to_standard(cube):
    one, many = rows_of(cube)[:3], rows_of(cube)[3:]
    assert [(row["compared"], row["error"], row["method"]) for row in one + many] == [
        ("one trajectory", "1e-06", label("ruth")),
        ("one trajectory", "1e-09", label("babs7o7h")),
        ("one trajectory", "1e-12", label("ruth")),
        ("ensembles", "1e-06", label("babs7o7h")),
        ("ensembles", "1e-09", label("babs7o7h")),
        ("ensembles", "1e-12", label("ruth")),
    ]
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
    monkeypatch.setattr(comparisons, "read_parts", lambda _, name, __: ([("5", ("max",), measured[name])], {}))
    found = {pair.system: pair for pair in pairs(cube, list(measured))[0]}
    assert [found[name].original for name in measured] == ["", "far", "", "", "kepler"]
    assert [found[name].standard(1e-9, "trajectory") for name in measured] == [10, 10, 30, 40, 40]
    assert [curve.solver for curve in found["far_regularised"].others] == ["heyoka", "heyoka_regularised"]
    assert found["far_regularised"].own_original == measured["far"][:1]
    # With another perturbation the energies differ, and so do the equations.
    known["kepler"] = defined("kepler", parameters={"GM": "1.8"})
    assert pairs(cube, ["kepler", "kepler_regularised"])[0][1].original == ""


@pytest.mark.slow
def test_positions_are_compared_where_they_were_of_interest(tmp_path):
    path = written(tmp_path / "times.h5", {"sho": ["max", "position"]}, sho=solvers(), kepler=solvers())
    rows = [row for row in rows_of(path, ("sho", "kepler")) if row["measure"] == "position"]
    assert {row["system"] for row in rows} == {systems["sho"].label}
    # timed() makes position errors ten times those of the energy: 1e-9 lies between the last two points.
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
    figure = regularised_figures(names, path)["figure"]
    energy, position = figure.axes
    known = looks(figure.legends[0])
    assert list(known) == [
        "fastest method here, regularised",
        "BAB's9o7H, regularised",
        "fastest method here, original equations",
        "heyoka (adaptive Taylor), original equations",
        "heyoka, regularised equations",
    ]
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
    figure = figure_of_file(str(tmp_path / "times.csv"))["figure"]
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
        {
            "BAB's9o7H, regularised": {0.5: 1e-6, 0.7: 1e-12},
            "heyoka, fast_math, original equations": {2: 1e-6},
        },
        {"fastest method here, regularised": {3: 1e-6, 4: 1e-12}},
    ]
    titles = [axes.get_title(loc="left").partition("  ")[2] for axes in figure.axes]
    assert titles == [f"Sun-Mercury orbit, e = {e}, $t$ = 87660 h" for e in ("0.2", "0.9")]


def test_file_beside_the_page_has_times_of_all_curves():
    panels = figure_of_file(str(Path(__file__).parents[4] / "docs/results/regularised.csv"))["figure"].axes
    assert [len(axes.get_lines()) for axes in panels] == [8] * 4


def test_curves_of_regularised_problem_are_told_apart_by_all_readers():
    found = [(*look(Line2D([], [], **drawn)), drawn.get("linewidth", 1) > 4) for _, drawn in CURVES.values()]
    for (colour, *form), (other, *like) in combinations(found, 2):
        assert difference(colour, other, "deuteranopia") >= 10 or form != like


def test_ensembles_are_timed_for_methods_among_fastest_at_some_error(monkeypatch):
    monkeypatch.setattr("nearharmonic_paper.experiments.work_precision.run.FRONT", 1)
    assert front_runners(curves(*solvers()), ("max",)) == ["leapfrog", "ruth", "babs7o7h"]
    assert front_runners(curves(*solvers()[:2]), ("max",)) == ["ruth", "babs7o7h"]
    assert front_runners(curves(timed("ruth", [nan], [1.0])), ("max",)) == []


@pytest.mark.slow
def test_figures_show_winning_methods_and_every_library(cube):
    found = comparison_figures(["sho", "kepler"], cube)
    shown = {
        "trajectory": ["ruth", "babs7o7h", "heyoka", "rebound_ias15"],
        "lanes": ["babs7o7h", "ruth", "heyoka"],
    }
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


@pytest.mark.slow
def test_figures_are_drawn_where_nothing_but_one_method_was_timed(tmp_path):
    path = written(tmp_path / "times.h5", {}, sho=[timed("ruth", [1e-3], [1e-4])])
    for figure in comparison_figures(["sho"], path).values():
        assert len(figure.axes) == 1
        figure.canvas.draw()
    assert comparison(["sho"], path)["table"].rows == []
