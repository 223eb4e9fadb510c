"""Recommended methods: their runs made again, what may be chosen, other libraries, questions that are refused."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import mpmath
import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import ldexp, mpf

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.commands.choice import ranking
from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.output.table import printed
from nearharmonic.recommendation import measure as engine
from nearharmonic.recommendation import recommend as ranks
from nearharmonic.recommendation.measure import Solver, variables
from nearharmonic.recommendation.recommend import recommendation, step_text
from nearharmonic.recommendation.search import Choice, Search, orbits
from nearharmonic.systems import systems
from nearharmonic.theory.oscillator import harmonic_energy_error
from support.methods.own_systems import mode, spring
from support.oracles.multiprecision import energy_errors

FEW = ("ruth", "aba864", "babps9o7h")
TWO = """
from nearharmonic import Tableau

def leapfrog(name):
    return Tableau(name=name, order=2, first="kick", kick=("0.5", "0.5"), drift=("1",), source="Newton", digits=20)

TABLEAUS = (leapfrog("one"), leapfrog("two"))
"""
SPRING = """
from nearharmonic import System
SYSTEM = System(name="my_spring", V=lambda q: q[0] ** 2 / 2, q0=1, p0=0, t_end=20)
"""


def chain(sites):
    """Unit masses between unit springs, whose ends are held; the first one is displaced."""
    q0 = [1, *[0] * (sites - 1)]

    def V(q):
        held = (0, *q, 0)
        return sum((held[i + 1] - held[i]) ** 2 for i in range(sites + 1)) / 2

    return nh.System(name="chain", V=V, q0=q0, p0=[0] * sites, t_end=10)


@numba.njit
def sine(q):
    return -2 * np.cos(q[0])


@numba.njit
def sine_gradient(q):
    return (2 * np.sin(q[0]),)


SINE = nh.System(name="sine", V=sine, grad_V=sine_gradient, q0=1, p0=0, t_end=20)


def run_of(system, found, i, **more):
    """The run of rank i + 1, by the function that anyone would call with what is returned."""
    more |= {"summation": str(found.summation[i].values)}
    return nh.integrate(system, str(found.integrator[i].values), float(found.tau[i]), **more)


@pytest.mark.parametrize(
    ("system", "error", "measure", "more"),
    [
        ("kepler", "1e-6", "max", {}),
        ("henon_heiles", 1e-4, "mean", {"q0": ["1/3", 0.1], "t_end": "60"}),
        ("henon_heiles", 1e-9, "max", {"p0": [Fraction(1, 7), "0.3"], "t_end": 33.3}),
        ("sho", 1e-3, "max", {"q0": 2, "p0": -0.7}),
    ],
)
def test_returned_run_equals_integrate_bitwise_and_meets_error(system, error, measure, more):
    found = nh.recommend(system, error, measure=measure, methods=FEW, **more)
    assert sorted(found.integrator.values) == sorted(FEW)
    assert found["rank"].values.tolist() == [1, 2, 3]
    for i in range(3):
        run = run_of(system, found, i, samples=2, **more)
        for name in ("tau", "steps", "evaluations", "max_energy_error", "mean_energy_error"):
            assert run[name].item() == found[name][i].item(), name
        assert found[f"{measure}_energy_error"][i] <= float(error)
    best = eval(found.attrs["call"], {"nh": nh})
    assert best.attrs["integrator"] == found.integrator[0].item()
    assert best.max_energy_error.item() == found.max_energy_error[0].item()


def test_printed_call_has_all_digits_of_a_start():
    asked = Search("sho", 1e-2, q0=[ldexp(mpf(3**60, prec=96), -90)], p0=[np.longdouble(0.5)], t_end=10)
    assert asked.arguments == ("'sho'", f"q0=['{Fraction(3**60, 2**90)}']", "p0=['1/2']")


def test_errors_equal_those_of_steps_in_multiprecision():
    q0, p0 = [0.25, 0.125], [0.0, 0.375]
    found = nh.recommend("henon_heiles", 1e-5, q0=q0, p0=p0, t_end=50, methods=FEW, measure="mean")
    for i in range(3):
        tableau, tau = integrators[str(found.integrator[i].values)], mpf(found.tau[i].item())
        steps = int(found.steps[i])
        start = [*map(mpf, q0)], [*map(mpf, p0)]
        errors = [float(one) for one in energy_errors(tableau, nh.systems["henon_heiles"], tau, steps, start)]
        worst, mean = max(errors), sum(errors) / steps
        # Rounding of doubles, 1e-16 a step of at most 1e4 operations, beside errors of 1e-5.
        assert found.max_energy_error[i].item() == pytest.approx(worst, abs=1e-12)
        assert found.mean_energy_error[i].item() == pytest.approx(mean, abs=1e-12)
        assert mean <= 1e-5


def test_a_mean_meets_the_error_however_many_samples_are_kept():
    # Sums over other blocks differ in their last digits: the bound is one of them, which others exceed.
    samples = (2, 7, 100, 1000)
    for steps in range(300, 400):
        means = [nh.integrate("sho", "ruth", 500 / steps, samples=n).mean_energy_error.item() for n in samples]
        if means[0] < max(means):
            break
    assert means[0] < max(means)
    found = nh.recommend("sho", means[0], measure="mean", methods=["ruth"])
    assert found.steps.item() > steps
    for n in samples:
        assert run_of("sho", found, 0, samples=n).mean_energy_error <= means[0]


def test_times_are_in_seconds_and_rank_the_methods(monkeypatch):
    monkeypatch.setattr(ranks, "interleaved", lambda calls, _: [[3.0, 1.0 - 0.25 * i] for i, _ in enumerate(calls)])
    found = nh.recommend("sho", 1e-3, methods=FEW)
    assert found.integrator.values.tolist() == [*reversed(FEW)]
    assert found.time.values.tolist() == [0.5, 0.75, 1.0]
    assert found.time.attrs["units"] == "s"


@pytest.mark.slow
def test_no_run_exceeds_budget_or_five_quarters_of_it(monkeypatch):
    longest, integrate_batch = [], engine.integrate_batch

    def watched(system, tableau, *, steps, **more):
        longest.append(max(steps) * tableau.stages * 50 / more["t_end"])  # over the interval that is asked for
        return integrate_batch(system, tableau, steps=steps, **more)

    monkeypatch.setattr(engine, "integrate_batch", watched)
    free = nh.recommend("henon_heiles", 1e-6, t_end=50, methods=FEW)
    needed = dict(zip(free.integrator.values.tolist(), free.evaluations.values.tolist(), strict=True))
    longest.clear()
    few = nh.recommend("henon_heiles", 1e-6, t_end=50, methods=FEW, budget=needed["aba864"])
    assert set(few.integrator.values) == {"aba864", "babps9o7h"}
    assert (few.evaluations <= needed["aba864"]).all()
    assert max(longest) <= needed["aba864"] * 5 / 4
    assert re.fullmatch(r"ruth \(\d\.\de-05 at tau 0\.\d+ at best\)", few.attrs["missed"])
    assert few.attrs["budget"] == needed["aba864"]
    fewer = nh.recommend("henon_heiles", 1e-6, t_end=50, methods=FEW, budget=needed["aba864"] - 1)
    assert set(fewer.integrator.values) == {"babps9o7h"}


def test_a_budget_below_a_single_step_is_said():
    with pytest.warns(UserWarning, match="no method has an error of at most 0.001 within 9 evaluations"):
        found = nh.recommend("sho", 1e-3, methods=["ruth", "babps9o7h"], budget=9)
    assert found.sizes["rank"] == 0
    assert "babps9o7h (a single step takes 10 evaluations)" in found.attrs["not_run"]  # 9, and one to begin with
    assert "ruth (a stable step is below 1.6)" in found.attrs["not_run"]  # three steps of 167


def test_the_finest_run_within_a_small_budget_is_made():
    # Order 2 on the oscillator: the error falls as steps^-2, so that the fewest steps are known from one run.
    leapfrog = integrators["leapfrog"]
    error = nh.integrate("sho", leapfrog, 1 / 12, t_end=1).max_energy_error.item()
    budget = 12 * leapfrog.stages + leapfrog.first_same_as_last
    found = nh.recommend("sho", error, t_end=1, methods=["leapfrog"], budget=budget)
    assert found.steps.values.tolist() == [12]


@pytest.mark.slow
def test_methods_are_names_paths_tableaus_and_files_of_several(tmp_path):
    (tmp_path / "two.py").write_text(TWO)
    (tmp_path / "my_spring.py").write_text(SPRING)
    path, system = str(tmp_path / "two.py"), str(tmp_path / "my_spring.py")
    own = nh.Tableau(name="own", order=2, first="drift", kick=("1",), drift=("0.5", "0.5"), source="Newton", digits=20)
    found = nh.recommend(system, 1e-3, methods=["ruth", tmp_path / "two.py", own])
    assert sorted(found.integrator.values) == sorted(["ruth", f"{path}:one", f"{path}:two", "own"])
    for i, name in enumerate(found.integrator.values):
        if name != "own":
            assert run_of(system, found, i).max_energy_error <= 1e-3
    one = nh.recommend(Path(system), 1e-3, methods=[f"{path}:two", "ruth", "ruth"])
    assert sorted(one.integrator.values) == sorted([f"{path}:two", "ruth"])


@pytest.mark.slow
def test_all_methods_are_asked_if_none_is_named():
    found = nh.recommend(spring(), 1e-2, budget=2000)
    left_out = found.attrs["missed"] + found.attrs["not_run"]
    assert found.sizes["rank"] >= 10
    assert re.search(r"\(more than \d+ evaluations, and \w+ takes at most \d+\)", found.attrs["not_run"])
    named = {*found.integrator.values, *re.findall(r"(\w+)(?:, | \()", left_out)} & set(integrators)
    assert named == set(integrators)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"system": "keplr"}, "unknown system 'keplr'. Did you mean 'kepler'?"),
        ({"error": 0}, "error = 0 is not allowed: a finite number above 0"),
        ({"measure": "men"}, "measure = 'men' is not allowed: one of max, mean, position. Did you mean 'mean'?"),
        ({"t_end": -5}, "t_end = -5 is not allowed: a finite number above 0"),
        ({"system": spring(t_end="-20")}, "t_end = '-20' is not allowed: a finite number above 0"),
        ({"q0": [1, 2]}, "q0 = [1, 2] is not allowed: 1 number, one per coordinate"),
        ({"q0": [[1], [2]], "measure": "position"}, "measure = 'position' is not allowed: max or mean for several"),
        ({"q0": [[1], [1e200]]}, "(q0, p0) of start 1 = [1e+200, 0.0] is not allowed: a start where the energy is"),
        ({"q0": [1e200]}, "is not allowed: the energy of sho there is"),
        ({"methods": ["rut"]}, "unknown integrator 'rut'. Did you mean 'ruth'?"),
        ({"methods": "ruth"}, "methods = 'ruth' is not allowed: a list of at least one name, file path or Tableau"),
        ({"methods": ["nowhere.py"]}, "nowhere.py: no such file"),
        ({"methods": ["ruth", integrators["ruth"].role("kick")]}, "methods = 'ruth' is not allowed: two methods have"),
        ({"budget": 0}, "budget = 0 is not allowed: an integer from 1 to 1000000000"),
    ],
)
def test_a_bad_question_is_one_sentence_before_any_method_runs(asked, says, monkeypatch):
    monkeypatch.setattr(engine, "integrate_batch", lambda *_, **__: pytest.fail("a method was run"))
    with pytest.raises(NearharmonicError, match=re.escape(says)) as raised:
        nh.recommend(**{"system": "sho", "error": 1e-3, **asked})
    assert "\n" not in str(raised.value)


def half_trace(tableau, x):
    """Half the trace of a step of the oscillator of frequency 1 and length x: beyond 1 the step is unstable."""
    K, moves = np.eye(2), list(tableau.outer)
    for i, inner in enumerate(tableau.inner):
        moves.insert(2 * i + 1, inner)
    for i, move in enumerate(moves):
        drifts = (tableau.first == "drift") == (i % 2 == 0)
        K = np.array([[1, float(move) * x], [0, 1]] if drifts else [[1, 0], [-float(move) * x, 1]]) @ K
    return abs(np.trace(K)) / 2


@pytest.mark.slow
def test_steps_are_stable_for_modes_that_do_not_move(monkeypatch):
    monkeypatch.setattr(Search, "_further_error", lambda *_: 0.0)  # which would find some of these steps
    sites = 32
    system = dataclasses.replace(chain(sites), q0=mode(sites).round(9).tolist(), t_end="250")
    found = nh.recommend(system, 1e-8, methods=["babps9o7h", "predescu_s3"])
    assert found.sizes["rank"] == 2
    fastest = 2 * np.cos(np.pi / (2 * sites + 2))  # of the harmonic chain with fixed ends
    for name, tau in zip(found.integrator.values.tolist(), found.tau.values.tolist(), strict=True):
        assert max(half_trace(integrators[name], x * fastest) for x in np.linspace(0.01, tau, 500)) <= 1 + 1e-8, name
        # Seen from a start that moves every mode by little.
        longer = nh.integrate(system, name, tau, t_end=4000, q0=mode(sites) + 1e-7 * mode(sites, sites), samples=2)
        assert longer.max_energy_error < 2e-8, name
    assert "the largest frequency along the orbit, 2, times the step is below" in found.attrs["basis"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "exact"),
    [
        (dataclasses.replace(chain(30), t_end="20"), 2 * np.cos(np.pi / 62)),  # of more modes than products
        (nh.System(name="masses", V=lambda q: (q[0] ** 2 + 9 * (q[1] - q[0]) ** 2) / 2, masses=(2, 0.5), q0=(1, 0),
                   p0=(0, 0), t_end=20), np.sqrt(max(np.linalg.eigvals([[5, -4.5], [-18, 18]])))),
        (spring(V=lambda q, t: 2 * q[0] ** 2 + q[0] * t, grad_V=None, time_dependent=True), 2),
        (SINE, np.sqrt(2)),  # whose V is a function of numba
        (spring(V=lambda q: -q[0] ** 2 / 2, grad_V=None, t_end="3"), 0),
    ],
    ids=["chain", "masses", "time", "numba", "saddle"],
)  # fmt: skip
def test_largest_frequency_is_that_of_the_eigenvalues(system, exact):
    from nearharmonic.engine.numbers import standard_start

    found = orbits(system, Fraction(system.t_end), standard_start(system, False)[None, :], 20_000).frequency
    assert exact * (1 - 1e-6) <= found <= exact * 1.01 + 1e-6


def test_ensemble_near_escape_keeps_error_that_one_start_misses():
    """5e-10 below the energy of escape, an orbit towards a saddle leaves if its energy is wrong by 1e-8."""
    H, angles = 1 / 6 - 5e-10, np.arange(1000) * np.pi / 500
    start = {"q0": np.zeros((1000, 2)), "p0": np.sqrt(2 * H) * np.column_stack([np.cos(angles), np.sin(angles)])}

    def worst(**one):
        found = nh.recommend("henon_heiles", 1e-8, methods=["trained_light"], t_end=200, **one)
        return found, nh.ensemble("henon_heiles", "trained_light", found.tau.item(), t_end=200, **start)

    alone, errors = worst(q0=[0, 0], p0=start["p0"][0])
    assert alone.max_energy_error.item() <= 1e-8
    assert errors.max_energy_error.max() > 0.1
    found, errors = worst(**start)
    assert errors.max_energy_error.max() <= 1e-8
    sums = nh.ensemble("henon_heiles", "trained_light", found.tau.item(), t_end=200, summation="plain", **start)
    assert found.summation.item() == "plain"
    assert found.max_energy_error.item() == np.sort(sums.max_energy_error.values)[989]
    assert found.max_energy_error.attrs["long_name"].startswith("0.99 quantile over 1000 starts of maximum of |H - H0|")
    assert found.attrs["starts"] == 1000
    assert eval(found.attrs["call"], {"nh": nh, **start}).sizes["member"] == 1000


def test_step_that_is_not_confirmed_comes_last_and_is_named(monkeypatch):
    further = {"ruth": math.inf, "aba864": 1e-3, "babps9o7h": 2e-3}
    monkeypatch.setattr(Search, "_further_error", lambda _, choice: further[choice.method])
    monkeypatch.setattr(ranks, "interleaved", lambda calls, _: [[1.0 + i] for i, _ in enumerate(calls)])
    found = nh.recommend("sho", 1e-3, methods=FEW, t_end=50)
    assert found.integrator.values.tolist() == ["aba864", "babps9o7h", "ruth"]
    assert found.further_error.values.tolist() == [1e-3, 2e-3, math.inf]
    assert found.attrs["unconfirmed"] == "ruth (inf)"
    told = ranking(recommendation(Search("sho", 1e-3, methods=FEW, t_end=50)))
    assert "ranked last, as not confirmed from other starts and over a longer interval: ruth (inf)" in told.notes


def test_each_method_has_a_line_on_a_terminal_alone(capsys):
    lines = []
    recommendation(Search("sho", 1e-3, methods=FEW, t_end=50), report=lines.append)
    for i, name in enumerate(FEW, 1):
        assert any(line.startswith(f"{i} of 3: {name}: met, error") for line in lines)
    nh.recommend("sho", 1e-3, methods=FEW, t_end=50)
    assert capsys.readouterr() == ("", "")


#: Rank, name, two spaces, kind, step, no tolerance, sums; evaluations, milliseconds, ratio and error come after.
ROW = re.compile(
    r"^ +(\d+) +(\S.*?) {2,}splitting +([-+.e\d]+) +- +(?:plain|compensated) +(\d+) +([.e\d]+) +([.\d]+) +(\S+)$"
)
#: The methods that an interpolation between six step sizes a decade recommended at steps that miss the error, by
#: factors of 3 to 46, with two that it did not.
SLIPPERY = ("babs7o7h", "babps8o7h", "babps9o7h", "srkn_a14", "ruth")


def asked(capsys, *question):
    """(rows, text, status) of ``nearharmonic recommend``."""
    status = main(["recommend", *question, "--methods", ",".join(SLIPPERY)])
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


@pytest.mark.slow
def test_finer_steps_that_search_did_not_choose_meet_error_too(capsys):
    for _, name, step, *_ in check(capsys, "sho", "1e-6"):
        n = steps_in("500", float(step))
        # 20 numbers of steps in even ratios up to twice as many.
        finer = nh.sweep("sho", name, [500 / (n * 2 ** (i / 20)) for i in range(1, 21)])
        assert float(finer.max_energy_error.max()) <= 1e-6, name


def test_no_oscillator_error_exceeds_its_supremum_in_closed_form(capsys):
    for _, name, step, *_, error in check(capsys, "sho", "1e-3"):
        tau = Fraction(500) / steps_in("500", float(step))
        bound = harmonic_energy_error(integrators[name], float(tau))
        # Two digits are printed, which moves the error by 5 % at most; 180 phases miss the largest error by far less.
        assert 0.95 * bound < float(error) < 1.05 * bound, name


def test_steps_for_a_position_end_where_the_cosine_says(capsys):
    rows, text, _ = asked(capsys, "sho", "--error", "1e-6", "--measure", "position")
    assert len(rows) == len(SLIPPERY)
    for _, name, step, *_, error in rows:
        run = nh.integrate("sho", name, float(step), samples=2, summation=sums_of(text)[name])
        distance = abs(float(run.q[-1, 0]) - float(mpmath.cos(500)))  # relative to |q(0)| = 1
        assert distance <= 1e-6
        assert float(error) == pytest.approx(distance, rel=0.05)  # two digits are printed


def test_run_that_is_timed_is_run_that_is_printed(capsys, monkeypatch):
    timed = {}

    def call(system, tableau, t_end, steps, summation, mode):
        assert mode == "trajectory"
        timed[tableau.name] = (system.name, t_end, steps, summation)
        return lambda: None

    monkeypatch.setattr(ranks, "prepared_call", call)
    monkeypatch.setattr(ranks, "interleaved", lambda calls, _: [[9.0, 6e-3 - 1e-3 * i] for i, _ in enumerate(calls)])
    rows, text, _ = asked(capsys, "sho", "--error", "1e-3")
    sums = sums_of(text)
    assert timed == {name: ("sho", "500", steps_in("500", float(step)), sums[name]) for _, name, step, *_ in rows}
    assert [row[4] for row in rows] == ["2", "3", "4", "5", "6"]
    assert [row[1] for row in rows] == [*reversed(SLIPPERY)]


@pytest.mark.parametrize("steps", [310, 333, 400])
def test_plain_sums_never_exceed_bound_that_compensated_ones_meet(steps):
    """At these steps of BABs7o7H plain sums err by 1e-10 to 3e-9 more, on a curve that falls from there on."""
    careful, plain = (
        float(nh.integrate("sho", "babs7o7h", Fraction(500, steps), samples=2, summation=way).max_energy_error)
        for way in ("compensated", "plain")
    )
    assert careful < plain
    (choice,) = recommendation(Search("sho", repr(careful), methods=["babs7o7h"])).choices
    assert (choice.status, choice.steps) == ("met", steps)
    assert choice.error <= careful


@given(steps=st.integers(1, 10**6), t_end=st.sampled_from(["500", "87660", "20", "0.1", "12345.678"]))
def test_a_printed_step_gives_the_same_number_of_steps(steps, t_end):
    text = step_text(Choice(method="m", label="M", tau=float(Fraction(t_end) / steps), steps=steps), t_end)
    assert steps_in(t_end, float(text)) == steps


@pytest.mark.parametrize(
    ("tau", "steps", "text"), [(500 / 474, 474, "1.055"), (500 / 30001, 30001, "0.016666"), (500.0, 1, "500")]
)  # 0.01667 would be 29994 steps
def test_printed_step_has_four_digits_or_as_many_as_needed(tau, steps, text):
    assert step_text(Choice(method="m", label="M", tau=tau, steps=steps), "500") == text


#: Methods that are asked beside other libraries.
THREE = ("ruth", "aba864", "srkn_a14")
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


def beside(results, system, error, **more):
    """Three methods beside timings of other libraries."""
    return recommendation(Search(system, error, methods=THREE, **more), results)


def text_of(found):
    return printed(ranking(found), "table")


def test_other_libraries_are_taken_from_the_timings_that_are_there(results):
    found = beside(results, "sho", "1e-6")
    assert {choice.method for choice in found.choices} == {*THREE, "theirs", "lucky", "absent"}
    assert found.choices[0].method == "lucky"
    assert found.search.t_end == "500"
    assert f"other libraries: {results}/cubes/work_precision.h5, measured 2026-01-02T03:04:05+00:00 on Fast 9" in (
        found.basis
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "tolerance", "time"), [(1e-5, 1e-3, 1e-9), (1e-6, 1e-9, 2e-9), (2e-9, 1e-9, 2e-9), (2e-12, 1e-9, 2e-9)]
)
def test_other_library_keeps_fastest_setting_that_meets_error(results, error, tolerance, time):
    theirs = choice_of(beside(results, "sho", error), "theirs")
    assert (theirs.status, theirs.tolerance, theirs.time) == ("met", tolerance, time)


def test_setting_is_no_choice_if_finer_one_misses_error(results):
    found = beside(results, "sho", 1e-9)
    assert choice_of(found, "lucky").status == "missed"
    text = text_of(found)
    assert "not at any setting timed: LUCKY (1.0e-10 at tolerance 0.001, but not at all finer ones)" in text


def test_coarse_setting_that_meets_error_by_luck_is_passed_over(tmp_path):
    patchy = made("patchy", [1e-10, 1e-3, 1e-10], [1e-9, 2e-9, 3e-9])
    choice = choice_of(beside(written(tmp_path, [patchy]), "sho", 1e-9), "patchy")
    assert (choice.status, choice.tolerance) == ("met", 1e-9)


def test_text_has_setting_evaluations_time_ratio_and_error_of_methods(results):
    text = text_of(beside(results, "sho", 1e-7, measure="mean")).splitlines()
    assert text[0] == "simple harmonic oscillator, t = 500: mean of |H - H0|/|H0| <= 1e-07"
    assert " ".join(text[1].split()) == "rank method kind tau tolerance sums evaluations ms ratio error"
    assert text[2].split() == ["1", "LUCKY", "peer", "-", "0.001", "-", "100", "1e-06", "1", "5e-11"]
    assert text[3].split() == ["2", "THEIRS", "peer", "-", "1e-09", "-", "300", "2e-06", "2", "1e-12"]
    assert "not run: ABSENT (not installed)" in text
    assert "on Fast 9" in text[-2]
    assert text[-1].startswith("the best in Python: nh.integrate('sho', ")


def test_unreached_error_is_reported_with_budget_and_best_method(results):
    found = beside(results, "sho", 1e-20)
    assert found.ranked == ()
    text = text_of(found)
    assert "no method reaches this error within 200000 evaluations" in text
    assert re.search(r"not within 200000 evaluations: ruth \(\d\.\de-\d+ at tau 0\.\d+ at best\); ", text)
    assert "not at any setting timed: THEIRS (2.0e-12 at tolerance 1e-09 at best); LUCKY" in text


@pytest.mark.slow
def test_a_system_of_ones_own_is_measured_on_the_spot(tmp_path):
    (tmp_path / "quartic.py").write_text(QUARTIC)
    found = beside(tmp_path, str(tmp_path / "quartic.py"), 1e-6, measure="position")
    assert found.search.system.name == "quartic"
    assert "not timed for a system of your own" in found.basis
    assert "aba864" in [choice.method for choice in found.ranked]


def test_broken_timings_are_named_and_not_measured_around(tmp_path):
    (tmp_path / "cubes").mkdir()
    (tmp_path / "cubes/work_precision.h5").write_bytes(b"not HDF5")
    with pytest.raises(ResultFileError, match="is truncated or no result file"):
        beside(tmp_path, "sho", 1e-9)


NAMES = ("ruth", "rowlands", "chin_4a", "trained_modified")


@pytest.mark.slow
@pytest.mark.parametrize("measure", ["max", "mean"])
def test_a_recommended_run_is_that_of_integrate(measure):
    found = nh.recommend("henon_heiles", 1e-5, measure=measure, methods=NAMES, t_end=50, budget=20000)
    assert set(found.integrator.values) == set(NAMES)
    for one in (found.isel(rank=i) for i in range(found.sizes["rank"])):
        run = nh.integrate("henon_heiles", str(one.integrator.values), float(one.tau), t_end=50,
                           summation=str(one.summation.values))  # fmt: skip
        assert run[f"{measure}_energy_error"] <= 1e-5
        assert (one.max_energy_error, one.evaluations) == (run.max_energy_error, run.evaluations)


@pytest.mark.slow
def test_processed_method_is_measured_along_its_runs_not_at_ends():
    """The energy error at the end of the interval alone is a tenth of the largest one, and would take longer steps."""
    found = nh.recommend("henon_heiles", 1e-5, methods=["rowlands"], t_end=50, budget=20000).isel(rank=0)
    ends = nh.integrate("henon_heiles", "rowlands", float(found.tau), t_end=50, samples=1)
    assert ends.max_energy_error < found.max_energy_error / 2
    assert 1e-6 < found.max_energy_error <= 1e-5


@pytest.mark.slow
def test_processed_methods_are_run_from_every_start():
    x = np.linspace(-0.1, 0.1, 12)
    starts = np.column_stack([x, 0.2 + x])
    found = nh.recommend("henon_heiles", 1e-4, methods=["rowlands"], q0=starts, t_end=20).isel(rank=0)
    runs = nh.ensemble("henon_heiles", "rowlands", float(found.tau), q0=starts, t_end=20, samples=1000,
                       summation=str(found.summation.values))  # fmt: skip
    assert found.max_energy_error == runs.max_energy_error.max() <= 1e-4


@pytest.mark.slow
def test_methods_that_do_not_fit_are_named_with_the_reason():
    loops = replace(systems["relativistic_oscillator"], name="loops")
    with pytest.warns(UserWarning, match="no method has an error of at most 0.01 within 2000 evaluations"):
        found = nh.recommend(loops, 1e-2, methods=["ruth", "chin_4a", "rowlands"], budget=2000)
    assert "chin_4a, rowlands (does not fit: it requires a quadratic kinetic energy)" in found.attrs["not_run"]
    found = nh.recommend("kepler_regularised", 1e-2, methods=["ruth", "rowlands"], budget=2000)
    assert found.attrs["not_run"] == "rowlands (does not fit: its kicks are of a modified potential)"
