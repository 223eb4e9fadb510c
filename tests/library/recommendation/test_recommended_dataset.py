"""``nearharmonic.recommend``: each run that it returns, made again; what may be chosen; questions that are refused."""

from __future__ import annotations

import dataclasses
import math
import re
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from mpmath import ldexp, mpf

import nearharmonic as nh
from nearharmonic.commands.choice import ranking
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.recommendation import choices
from nearharmonic.recommendation.question import question
from nearharmonic.recommendation.stability import orbits
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
    asked = question("sho", 1e-2, q0=[ldexp(mpf(3**60, prec=96), -90)], p0=[np.longdouble(0.5)], t_end=10)
    assert asked.arguments == ("'sho'", f"q0=['{Fraction(3**60, 2**90)}']", "p0=['1/2']")


def test_errors_equal_those_of_steps_in_multiprecision():
    q0, p0 = [0.25, 0.125], [0.0, 0.375]
    found = nh.recommend("henon_heiles", 1e-5, q0=q0, p0=p0, t_end=50, methods=FEW, measure="mean")
    for i in range(3):
        tableau, tau, steps = (
            integrators[str(found.integrator[i].values)],
            mpf(found.tau[i].item()),
            int(found.steps[i]),
        )
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
    monkeypatch.setattr(choices, "interleaved", lambda calls, _: [[3.0, 1.0 - 0.25 * i] for i, _ in enumerate(calls)])
    found = nh.recommend("sho", 1e-3, methods=FEW)
    assert found.integrator.values.tolist() == [*reversed(FEW)]
    assert found.time.values.tolist() == [0.5, 0.75, 1.0]
    assert found.time.attrs["units"] == "s"


@pytest.mark.slow
def test_no_run_exceeds_budget_or_five_quarters_of_it(monkeypatch):
    longest, integrate_batch = [], choices.integrate_batch

    def watched(system, tableau, *, steps, **more):
        longest.append(max(steps) * tableau.stages * 50 / more["t_end"])  # over the interval that is asked for
        return integrate_batch(system, tableau, steps=steps, **more)

    monkeypatch.setattr(choices, "integrate_batch", watched)
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
        ({"t_end": "soon"}, "t_end = 'soon' is not allowed: a finite number above 0"),
        ({"system": spring(t_end="-20")}, "t_end = '-20' is not allowed: a finite number above 0"),
        ({"q0": [1, 2]}, "q0 = [1, 2] is not allowed: 1 number, one per coordinate"),
        ({"p0": ["fast"]}, "p0[0] = 'fast' is not allowed: a finite number"),
        ({"q0": [[1], [2]], "measure": "position"}, "measure = 'position' is not allowed: max or mean for several"),
        ({"q0": [[1], [1e200]]}, "(q0, p0) of start 1 = [1e+200, 0.0] is not allowed: a start where the energy is"),
        ({"q0": [1e200]}, "is not allowed: the energy of sho there is"),
        ({"methods": ["rut"]}, "unknown integrator 'rut'. Did you mean 'ruth'?"),
        ({"methods": "ruth"}, "methods = 'ruth' is not allowed: a list of at least one name, file path or Tableau"),
        ({"methods": []}, "methods = [] is not allowed: a list of at least one name, file path or Tableau"),
        ({"methods": ["nowhere.py"]}, "nowhere.py: no such file"),
        (
            {"methods": ["ruth", integrators["ruth"].role("kick")]},
            "methods = 'ruth' is not allowed: two methods have this name",
        ),
        ({"budget": 0}, "budget = 0 is not allowed: an integer from 1 to 1000000000"),
        ({"budget": 1e5}, "budget = 100000.0 is not allowed: an integer"),
    ],
)
def test_a_bad_question_is_one_sentence_before_any_method_runs(asked, says, monkeypatch):
    monkeypatch.setattr(choices, "integrate_batch", lambda *_, **__: pytest.fail("a method was run"))
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
    monkeypatch.setattr(choices.Search, "_further_error", lambda *_: 0.0)  # which would find some of these steps
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
    monkeypatch.setattr(choices.Search, "_further_error", lambda _, choice: further[choice.method])
    monkeypatch.setattr(choices, "interleaved", lambda calls, _: [[1.0 + i] for i, _ in enumerate(calls)])
    found = nh.recommend("sho", 1e-3, methods=FEW, t_end=50)
    assert found.integrator.values.tolist() == ["aba864", "babps9o7h", "ruth"]
    assert found.further_error.values.tolist() == [1e-3, 2e-3, math.inf]
    assert found.attrs["unconfirmed"] == "ruth (inf)"
    told = ranking(choices.recommendation(question("sho", 1e-3, methods=FEW, t_end=50)))
    assert "not confirmed from other starts and over a longer interval, and therefore last: ruth (inf)" in told.notes


def test_each_method_has_a_line_on_a_terminal_alone(capsys):
    lines = []
    choices.recommendation(question("sho", 1e-3, methods=FEW, t_end=50), report=lines.append)
    for i, name in enumerate(FEW, 1):
        assert any(line.startswith(f"{i} of 3: {name}: met, error") for line in lines)
    nh.recommend("sho", 1e-3, methods=FEW, t_end=50)
    assert capsys.readouterr() == ("", "")
