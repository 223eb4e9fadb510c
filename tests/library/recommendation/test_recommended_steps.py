"""Output of `nearharmonic recommend`, run again: each step meets the error, and the order is that of the costs."""

from __future__ import annotations

import re
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.integrators import integrators
from nearharmonic.recommendation.recommend import printed_step, question, recommendation
from nearharmonic.theory.oscillator import harmonic_energy_error

#: Rank, name, two spaces, kind, step, no tolerance, sums; evaluations, milliseconds, ratio and error come after.
ROW = re.compile(
    r"^ +(\d+) +(\S.*?) {2,}splitting +([-+.e\d]+) +- +(?:plain|compensated) +(\d+) +([.e\d]+) +([.\d]+) +(\S+)$"
)

#: The methods that an interpolation between six step sizes a decade recommended at steps that miss the error, by
#: factors of 3 to 46, with two that it did not.
SLIPPERY = ("babs7o7h", "babps8o7h", "babps9o7h", "srkn_a14", "ruth")


def asked(capsys, *question):
    """(rows, text, status) of ``nearharmonic recommend``."""
    status = main(["recommend", *question, "--results", "/nowhere", "--limit", "100"])
    text = capsys.readouterr().out
    return [match.groups() for line in text.splitlines() if (match := ROW.match(line))], text, status


def steps_in(t_end, tau):
    """Number of steps as the package's contract words it: max(1, round(t_end / tau)), exactly."""
    return max(1, round(Fraction(t_end) / Fraction(tau)))


def sums_of(text):
    """Summation by name, as printed."""
    return dict(re.findall(r"^ +\d+ +(\S.*?) {2,}splitting .* (plain|compensated) ", text, re.MULTILINE))


def check(capsys, system, error, measure="max"):
    """Every step printed meets ``error`` when it is run by itself, and takes the evaluations printed."""
    rows, text, status = asked(capsys, system, "--error", error, "--measure", measure)
    assert (status, len(rows)) == (0, text.count("\n  ") - 1)
    for _, name, step, evaluations, *_ in rows:
        sums = sums_of(text)[name]
        run = nh.integrate(system, name, float(step), samples=2, summation=sums)
        assert float(run[f"{measure}_energy_error"]) <= float(error), name
        assert int(run.evaluations) == int(evaluations)
    return rows


@pytest.fixture
def slippery(monkeypatch):
    monkeypatch.setattr(
        "nearharmonic.recommendation.recommend.integrators",
        {name: integrators[name] for name in SLIPPERY},
    )


@pytest.mark.slow
@pytest.mark.usefixtures("slippery")
@pytest.mark.parametrize(
    ("system", "error", "measure"),
    [("sho", "1e-3", "max"), ("kepler", "1e-6", "max"), ("henon_heiles", "1e-3", "max"), ("kepler", "1e-3", "mean")],
)
def test_steps_among_resonances_meet_the_error_when_they_are_run(capsys, system, error, measure):
    rows = check(capsys, system, error, measure)
    assert {name for _, name, *_ in rows} == set(SLIPPERY)


@pytest.mark.slow
@pytest.mark.usefixtures("slippery")
def test_finer_steps_that_search_did_not_choose_meet_error_too(capsys):
    for _, name, step, *_ in check(capsys, "sho", "1e-6"):
        n = steps_in("500", float(step))
        # 20 numbers of steps in even ratios up to twice as many.
        finer = nh.sweep("sho", name, [500 / (n * 2 ** (i / 20)) for i in range(1, 21)])
        assert float(finer.max_energy_error.max()) <= 1e-6, name


@pytest.mark.usefixtures("slippery")
def test_no_oscillator_error_exceeds_its_supremum_in_closed_form(capsys):
    for _, name, step, *_, error in check(capsys, "sho", "1e-3"):
        tau = Fraction(500) / steps_in("500", float(step))
        bound = harmonic_energy_error(integrators[name], float(tau))
        # Two digits are printed, which moves the error by 5 % at most; 180 phases miss the largest error by far less.
        assert 0.95 * bound < float(error) < 1.05 * bound, name


@pytest.mark.usefixtures("slippery")
def test_steps_for_a_position_end_where_the_cosine_says(capsys):
    rows, text, _ = asked(capsys, "sho", "--error", "1e-6", "--measure", "position")
    assert len(rows) == len(SLIPPERY)
    for _, name, step, *_, error in rows:
        run = nh.integrate("sho", name, float(step), samples=2, summation=sums_of(text)[name])
        distance = abs(float(run.q[-1, 0]) - float(mpmath.cos(500)))  # relative to |q(0)| = 1
        assert distance <= 1e-6
        assert float(error) == pytest.approx(distance, rel=0.05)  # two digits are printed


@pytest.mark.usefixtures("slippery")
def test_run_that_is_timed_is_run_that_is_printed(capsys, monkeypatch):
    timed = {}

    def calls(system, tableau, t_end, steps, summation, modes):
        assert modes == ("trajectory",)
        timed[tableau.name] = (system.name, t_end, steps, summation)
        return {"trajectory": lambda: None}

    monkeypatch.setattr("nearharmonic.recommendation.recommend.prepared_calls", calls)
    monkeypatch.setattr(
        "nearharmonic.recommendation.recommend.interleaved",
        lambda calls, _: [[9.0, 6e-3 - 1e-3 * i] for i, _ in enumerate(calls)],
    )
    rows, text, _ = asked(capsys, "sho", "--error", "1e-3")
    sums = sums_of(text)
    assert timed == {name: ("sho", "500", steps_in("500", float(step)), sums[name]) for _, name, step, *_ in rows}
    assert [row[4] for row in rows] == ["2", "3", "4", "5", "6"]
    assert [row[1] for row in rows] == [*reversed(SLIPPERY)]


@pytest.mark.parametrize("steps", [310, 333, 400])
def test_plain_sums_never_exceed_bound_that_compensated_ones_meet(steps, monkeypatch):
    """At these steps of BABs7o7H plain sums err by 1e-10 to 3e-9 more, on a curve that falls from there on."""
    monkeypatch.setattr("nearharmonic.recommendation.recommend.integrators", {"babs7o7h": integrators["babs7o7h"]})
    careful, plain = (
        float(nh.integrate("sho", "babs7o7h", Fraction(500, steps), samples=2, summation=way).max_energy_error)
        for way in ("compensated", "plain")
    )
    assert careful < plain
    (choice,) = recommendation(question("sho", repr(careful))).choices
    assert (choice.status, choice.steps) == ("met", steps)
    assert choice.error <= careful


@given(steps=st.integers(1, 10**6), t_end=st.sampled_from(["500", "87660", "20", "0.1", "12345.678"]))
def test_a_printed_step_gives_the_same_number_of_steps(steps, t_end):
    text = printed_step(t_end, float(Fraction(t_end) / steps), steps)
    assert steps_in(t_end, float(text)) == steps


def test_printed_step_has_four_digits_or_as_many_as_needed():
    assert printed_step("500", 500 / 474, 474) == "1.055"
    assert printed_step("500", 500 / 30001, 30001) == "0.016666"  # 0.01667 would be 29994 steps
    assert printed_step("500", 500.0, 1) == "500"
