"""Methods for an error bound: choices of this package and of other libraries, their text, and bad questions."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from nearharmonic.commands.choice import ranking
from nearharmonic.errors import ResultFileError
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.output.answers import printed
from nearharmonic.recommendation.choices import recommendation
from nearharmonic.recommendation.measure import Solver, cross, variables
from nearharmonic.recommendation.question import question

QUARTIC = """
from nearharmonic.systems import System

SYSTEM = System(
    name="quartic",
    label="quartic oscillator",
    V=lambda q: sum(x**4 for x in q) / 4,
    grad_V=lambda q: tuple(x**3 for x in q),
    q0=("1", "0.5"),
    p0=("0", "1"),
    t_end="10",
    units={"q": "1", "p": "1", "t": "1", "energy": "1"},
    source="made up for this test",
)
"""


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Three methods instead of all: what is asked here does not depend on their number."""
    chosen = {name: integrators[name] for name in ("ruth", "aba864", "srkn_a14")}
    monkeypatch.setattr("nearharmonic.recommendation.question.integrators", chosen)
    return chosen


def made(method, errors, times, status="ok", tolerances=(1e-3, 1e-6, 1e-9)):
    """Another library: its settings with their errors and times."""
    worst = np.array(errors, dtype=float)
    columns = {"tolerance": tolerances[: worst.size], "max_energy_error": worst, "mean_energy_error": worst / 2}
    columns["evaluations"] = 100.0 * np.arange(1, worst.size + 1)
    repeats = {("trajectory", i): [3 * time, time] for i, time in enumerate(times)}
    return Solver(method=method, label=method.upper(), kind="peer", status=status, columns=columns, times=repeats)


def written(folder, curves, t_end="500"):
    """``folder`` with a file of timings of ``curves`` on the oscillator."""
    problems = {"sho": {"system": "sho", "t_end": t_end, "measures": ["max", "mean"], "reference": ""}}
    facts = {"measured": "2026-01-02T03:04:05+00:00", "cpu": "Fast 9", "problems": json.dumps(problems)}
    store.write(folder / "cubes/work_precision.h5", {}, facts, groups={"sho": variables(curves, "1")})
    return folder


@pytest.fixture
def results(tmp_path):
    """Timings of two libraries, the second of which errs again at its finest setting; a third is absent."""
    curves = [
        made("theirs", [2e-6, 2e-9, 2e-12], [1e-9, 3e-9, 2e-9]),
        made("lucky", [1e-10, 1e-10, 1e-7], [1e-9, 2e-9, 3e-9]),
        made("absent", [], [], status="not installed"),
    ]
    return written(tmp_path, curves)


def choice_of(found, method):
    return next(choice for choice in found.choices if choice.method == method)


def recommend(system, error, *, results, **more):
    """Result of the command."""
    return recommendation(question(system, error, **more), results)


def text_of(found):
    return printed(ranking(found), "table")


def test_other_libraries_are_taken_from_the_timings_that_are_there(results, few):
    found = recommend("sho", "1e-6", results=results)
    assert {choice.method for choice in found.choices} == {*few, "theirs", "lucky", "absent"}
    assert found.choices[0].method == "lucky"
    assert found.question.t_end == "500"
    assert f"other libraries: {results}/cubes/work_precision.h5, measured 2026-01-02T03:04:05+00:00 on Fast 9" in (
        found.basis
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "tolerance", "time"),
    [(1e-5, 1e-3, 1e-9), (1e-6, 1e-9, 2e-9), (2e-9, 1e-9, 2e-9), (2e-12, 1e-9, 2e-9)],
)
def test_other_library_keeps_fastest_setting_that_meets_error(results, error, tolerance, time):
    theirs = choice_of(recommend("sho", error, results=results), "theirs")
    assert (theirs.status, theirs.tolerance, theirs.time) == ("met", tolerance, time)


def test_setting_is_no_choice_if_finer_one_misses_error(results):
    found = recommend("sho", 1e-9, results=results)
    assert choice_of(found, "lucky").status == "missed"
    text = text_of(found)
    assert "not at any setting timed: LUCKY (1.0e-10 at tolerance 0.001, but not at all finer ones)" in text


def test_coarse_setting_that_meets_error_by_luck_is_passed_over(tmp_path):
    patchy = made("patchy", [1e-10, 1e-3, 1e-10], [1e-9, 2e-9, 3e-9])
    choice = choice_of(recommend("sho", 1e-9, results=written(tmp_path, [patchy])), "patchy")
    assert (choice.status, choice.tolerance) == ("met", 1e-9)


@pytest.mark.slow
def test_timings_over_another_interval_are_left_out(tmp_path):
    found = recommend("sho", 1e-6, results=written(tmp_path, [made("theirs", [1e-9] * 3, [1e-9] * 3)], t_end="50"))
    assert "theirs" not in {choice.method for choice in found.choices}
    assert "has no timings of this measure over this interval" in found.basis


def test_text_has_setting_evaluations_time_ratio_and_error_of_methods(results):
    text = text_of(recommend("sho", 1e-7, measure="mean", results=results)).splitlines()
    assert text[0] == "simple harmonic oscillator, t = 500: mean of |H - H0|/|H0| <= 1e-07"
    assert " ".join(text[1].split()) == "rank method kind tau tolerance sums evaluations ms ratio error"
    assert text[2].split() == ["1", "LUCKY", "peer", "-", "0.001", "-", "100", "1e-06", "1", "5e-11"]
    assert text[3].split() == ["2", "THEIRS", "peer", "-", "1e-09", "-", "300", "2e-06", "2", "1e-12"]
    assert "not run: ABSENT (not installed)" in text
    assert "on Fast 9" in text[-2]
    assert text[-1].startswith("the best in Python: nh.integrate('sho', ")


def test_unreached_error_is_reported_with_budget_and_best_method(results):
    found = recommend("sho", 1e-20, results=results)
    assert found.ranked == ()
    text = text_of(found)
    assert "no method reaches this error within 200000 evaluations" in text
    assert re.search(r"not within 200000 evaluations: ruth \(\d\.\de-\d+ at tau 0\.\d+ at best\); ", text)
    assert "not at any setting timed: THEIRS (2.0e-12 at tolerance 1e-09 at best); LUCKY" in text


def test_without_timings_methods_are_measured_and_libraries_listed_missing(tmp_path, few):
    found = recommend("sho", 1e-6, results=tmp_path)
    assert {choice.method for choice in found.choices} == set(few)
    assert found.ranked[0].status == "met"
    assert found.basis.startswith("measured on the spot")
    assert f"other libraries: not timed ({tmp_path}/cubes/work_precision.h5 does not exist" in found.basis


@pytest.mark.slow
def test_a_system_of_ones_own_is_measured_on_the_spot(tmp_path):
    (tmp_path / "quartic.py").write_text(QUARTIC)
    found = recommend(str(tmp_path / "quartic.py"), 1e-6, measure="position", results=tmp_path)
    assert found.question.system.name == "quartic"
    assert "not timed for a system of your own" in found.basis
    assert "aba864" in [choice.method for choice in found.ranked]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("", "maximum of |H - H0|/|H0| <= 0.001"),
        ('energy_scale="2",', "maximum of |H - H0|/(2 J) <= 0.001"),
        ("V=lambda q: sum(x**4 for x in q) / 4 - 0.765625,", "maximum of |H - H0| in J <= 0.001"),  # H0 = 0
    ],
)
def test_bound_is_said_in_words_of_energy_errors_of_system(tmp_path, change, says):
    text = QUARTIC.replace('"energy": "1"', '"energy": "J"').replace("    V=lambda q: sum(x**4 for x in q) / 4,", "")
    (tmp_path / "quartic.py").write_text(
        text.replace("    q0=", f"    {'' if 'V=' in change else 'V=lambda q: sum(x**4 for x in q) / 4,'} {change} q0=")
    )
    found = recommend(str(tmp_path / "quartic.py"), 1e-3, results=tmp_path)
    assert text_of(found).splitlines()[0].endswith(says)


def test_broken_timings_are_named_and_not_measured_around(tmp_path):
    (tmp_path / "cubes").mkdir()
    (tmp_path / "cubes/work_precision.h5").write_bytes(b"not HDF5")
    with pytest.raises(ResultFileError, match="is truncated or no result file"):
        recommend("sho", 1e-9, results=tmp_path)


def test_costs_between_two_points_are_those_of_the_power_law():
    """Costs grow as the fourth root of 1/error: from 1 at 1e-2 to 100 at 1e-10, hence to 10 at 1e-6."""
    for target, cost in ((1e-6, 10), (1e-8, 10**1.5), (1e-3, 10**0.25)):
        status, (found, tau) = cross([1e-2, 1e-10], [[1, 100], [1, 0.01]], target)
        assert (status, found, tau) == ("reached", pytest.approx(cost, rel=1e-14), pytest.approx(1 / cost, rel=1e-14))
