"""Runs of every kind have the same bits whatever function is called, beside other runs, and in parts."""

import gc
import pickle
import random
import subprocess
import sys
import weakref
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine import ensemble
from nearharmonic.engine.batch import integrate_batch, single_steps
from nearharmonic.engine.numbers import standard_parameters, standard_start, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.engine.setup import Setup
from nearharmonic.systems.remembered import remembered
from support.methods.numba_potentials import springs
from support.methods.own_systems import driven, mode, sites, spring
from support.oracles.multiprecision import digits_of
from support.oracles.oscillator_steps import CHAIN
from support.stress.random_cases import random_case
from support.stress.rounding_bounds import bounded_run, formulas

PLAIN, EXTENDED, EXACT = {"summation": "plain"}, {"precision": "extended"}, {"split": "exact_oscillator"}
RNG = np.random.default_rng(5)

ONE, THREE = {"q0": [[1.0], [0.5]], "p0": [[0.0], [0.2]]}, {"q0": [[0.1, 0.2, 0.3]] * 3}
STARTS = {"q0": RNG.uniform(-0.3, 0.3, (5, 2)), "p0": RNG.uniform(-0.3, 0.3, (5, 2))}
TEXTS = {"q0": [["0", "0.1"], ["0.1", "1/7"]], "p0": [["0.1", "1/7"], ["0", "0.4"]]}
PLANETS = {"q0": 60 + 10 * STARTS["q0"], "parameters": {"GM": 1.7 + 0.1 * STARTS["q0"][:, 0]}}
#: Members have steps of their own.
BOUND = {"q0": [[60.0, 3.0], [100.0, 0.0], [40.0, 10.0]], "p0": [[0.0, 0.15], [0.0, 0.05], [-0.05, 0.17]]}
#: System, method, step size, initial values and parameters of members, settings. Most step sizes are short in binary.
KINDS = {
    **{
        f"henon_heiles {method} {how}": ("henon_heiles", method, 0.125, starts, how)
        for how in ({}, PLAIN, EXTENDED) for method, starts in (("aba864", {"p0": TEXTS["p0"]}), ("babps9o7h", STARTS))
    },
    **{f"kepler {how}": ("kepler", "babps9o7h", 100.0, PLANETS, how) for how in ({}, PLAIN, EXTENDED)},
    **{
        f"{system} {split} {how}": (system, "aba864", 0.25, starts, split | how)
        for system, split, starts in (("sho", {}, ONE), ("sho", EXACT, ONE))
        for how in ({}, PLAIN, EXTENDED)
    },
    f"henon_heiles {EXACT} {{}}": ("henon_heiles", "aba864", 0.25, STARTS, EXACT),
    **{
        f"{method} {how}": ("henon_heiles", method, 0.125, TEXTS, how)
        for method, how in (("chin_4a", {}), ("rowlands", PLAIN))
    },
    "regularised": ("kepler_regularised", "babs7o7h", 256.0, BOUND, {}),
}  # fmt: skip
#: More methods with a modified potential, systems of other kinds, and oscillators solved exactly; long in other
#: precisions, whose code all kinds share.
LONGER = {
    "ten sites": (sites(10), "aba864", 0.25, {"q0": [mode(10, k) for k in (1, 2, 5)]}, {}),
    **{
        f"henon_heiles {EXACT} {how}": ("henon_heiles", "aba864", 0.25, STARTS, EXACT | how)
        for how in (PLAIN, EXTENDED)
    },
    **{
        f"{method} {how}": ("henon_heiles", method, 0.125, TEXTS, how)
        for method in nh.modified_integrators for how in ({}, PLAIN, EXTENDED)
        if f"{method} {how}" not in KINDS
    },
    "processed, with parameters": ("kepler", "rowlands", 16.0, PLANETS, {}),
    **{
        f"driven {how}": (driven(), "aba864", 0.25, ONE | {"parameters": {"F": [0.5, 1.5], "w": [0.7, 0.3]}}, how)
        for how in ({}, EXTENDED)
    },
    "loops": (sites(70), "aba864", 0.25, {"q0": [mode(70, k) for k in (1, 2, 5)]}, {}),
    "numba": (springs(), "ruth", 0.125, {"q0": RNG.uniform(-1, 1, (5, 1)), "parameters": {"k": np.arange(1, 6)}}, {}),
    "regularised, plain sums": ("kepler_regularised", "babs7o7h", 256.0, BOUND, PLAIN),
    **{
        f"{method} {how} {len(starts['q0'])}": (system, method, 0.25, starts, EXACT | how)
        for system, method, starts in (
            ("sho", "babps9o7h", ONE), ("henon_heiles", "babps9o7h", STARTS), (CHAIN.system, "aba864", THREE),
            (CHAIN.system, "babps9o7h", THREE),
        )
        for how in ({}, PLAIN, EXTENDED)
    },
}  # fmt: skip


def marks_of(name):
    if name in KINDS:
        return []
    return [pytest.mark.slow if LONGER[name][-1].items() <= EXACT.items() else pytest.mark.long]


def every(*left_out):
    kinds = [
        pytest.param(*kind, id=name, marks=marks_of(name))
        for name, kind in (KINDS | LONGER).items()
        if kind[0] not in left_out
    ]
    return pytest.mark.parametrize(("system", "method", "tau", "members", "how"), kinds)


def assert_same(found, expected, names):
    for name in names:
        np.testing.assert_array_equal(found[name], expected[name], name)


@every()
def test_every_call_gives_the_bits_of_integrate(system, method, tau, members, how, monkeypatch):
    """An ensemble in blocks, and a prepared problem, which is called again and again."""
    monkeypatch.setattr(ensemble, "BLOCK", 2)
    how = how | {"t_end": 40 * tau, "samples": 3}
    many = nh.ensemble(system, method, tau, threads=1, **members, **how)
    problem = pickle.loads(pickle.dumps(nh.problem(system, method, **how)))
    for i in range(many.sizes["member"]):
        own = {key: {k: v[i] for k, v in x.items()} if key == "parameters" else x[i] for key, x in members.items()}
        problem(2 * tau)  # another step size, and the system's own start
        alone, found = nh.integrate(system, method, tau, **own, **how), problem(tau, **own)
        found = found if i else pickle.loads(pickle.dumps(found))
        names = ("q", "p", "energy_error", "max_energy_error", "initial_energy", "status")
        assert_same(many.isel(member=i), alone, names)
        assert found.to_dataset().drop_attrs().identical(alone.drop_attrs())
        names = ("q", "p", "t", "tau", "steps", "status", "max_energy_error", "evaluations")
        assert_same({name: getattr(found, name) for name in names}, alone, names)
    assert problem(tau).to_dataset().drop_attrs().identical(nh.integrate(system, method, tau, **how).drop_attrs())


@pytest.mark.slow
@every()
def test_neither_lanes_nor_samples_change_the_bits_of_a_run(system, method, tau, members, how):
    """The energies of processed states are measured at the samples; each sample of a regularised run takes forces."""
    how = how | {"t_end": 40 * tau}
    taus, times = [tau * factor for factor in (1, 0.5, 2, 0.25, 0.7)], [20.3 * tau, 40 * tau]
    swept, swept_at = nh.sweep(system, method, taus, **how), nh.sweep(system, method, taus, t=times, **how)
    for i, one in enumerate(taus):
        run, few = (nh.integrate(system, method, one, samples=n, **how) for n in (1000, 2))
        found = nh.integrate(system, method, one, t=times, **how)
        names = ("q", "p", "energy_error")
        assert_same(swept_at.isel(tau=i), found, (*names, "max_energy_error", "evaluations"))
        for other in (few, found):
            assert_same(other.isel(sample=-1), run.isel(sample=-1), (*names, "t", "steps"))
        processed = nh.integrators[method].processed
        assert_same(swept.isel(tau=i), run if processed else few, ("max_energy_error", "evaluations", "status"))
        if processed:
            continue
        assert few.max_energy_error == run.max_energy_error
        # The mean is summed in other blocks: a thousand roundings of its sum.
        assert few.mean_energy_error.item() == pytest.approx(run.mean_energy_error.item(), rel=1e-13)
        if system != "kepler_regularised":  # else there is a sample at each step, in doubles for many coordinates
            close, errors = 1e-6 if run.sizes["component"] > 8 else 1e-13, np.abs(run.energy_error.values[1:])
            assert run.max_energy_error.item() == pytest.approx(errors.max(), rel=close, abs=0)
            assert run.mean_energy_error.item() == pytest.approx(errors.mean(), rel=close, abs=0)


@every("kepler_regularised")
def test_a_run_in_two_parts_has_the_bits_of_one(system, method, tau, members, how):
    """The last step of a regularised run is shortened."""
    whole = nh.integrate(system, method, tau, t_end=40 * tau, samples=2, **how)
    half = nh.integrate(system, method, tau, t_end=20 * tau, samples=2, **how)
    rest = nh.integrate(system, method, tau, t_end=20 * tau, samples=333, start=half, **how)
    names = ["q", "p", "energy_error", *(name for name in ("q_low", "p_low") if name in whole)]
    assert_same(rest.isel(sample=-1), whole.isel(sample=-1), names)
    assert_same(rest.isel(sample=0), half.isel(sample=-1), ("q", "p"))
    # Relative to the energy of the first start, which is a double-double; with many coordinates it is a double.
    close = 1e-6 if whole.sizes["component"] > 8 else 1e-12
    assert rest.energy_error[0].item() == pytest.approx(half.energy_error[-1].item(), rel=close, abs=0)
    assert (rest.t[0], rest.t[-1]) == (half.t[-1], whole.t[-1])
    if not nh.integrators[method].processed:
        assert max(half.max_energy_error, rest.max_energy_error) == whole.max_energy_error


@pytest.mark.parametrize(
    "kind",
    [
        "kepler {}",
        f"henon_heiles {EXACT} {{}}",
        *(
            pytest.param(kind, marks=pytest.mark.slow)
            for kind in ("ten sites", *(f"henon_heiles {EXACT} {how}" for how in (PLAIN, EXTENDED)))
        ),
    ],
)
def test_the_energy_is_measured_when_it_was_asked_for(kind):
    """Far above rounding, the energy of ten sites is measured in doubles at every step."""
    system, method, tau, _, how = (KINDS | LONGER)[kind]
    each, few, none = (
        nh.integrate(system, method, tau, t_end=80 * tau, samples=9, energy=energy, **how)
        for energy in ("every", "samples", "none")
    )
    assert_same(each, few, ("q", "p", "energy_error")[: 2 if kind == "ten sites" else 3])
    assert_same(each, none, ("q", "p"))
    assert few.max_energy_error == np.abs(few.energy_error).max() < each.max_energy_error
    assert few.mean_energy_error.item() == pytest.approx(np.abs(few.energy_error[1:]).mean().item(), rel=1e-15)
    assert np.isnan(none.energy_error).all()
    assert np.isnan([none.max_energy_error, none.mean_energy_error, none.initial_energy]).all()


# --- Random runs with every setting: states and energies within the bound of their rounding errors, bits in any order


STATES = ("q", "p", "energy_error")


def assert_bounded(case, run):
    """Compare a run with its steps in mpmath; return True if all of it could be compared."""
    method, tau = case.method, Fraction(case.t_end) / case.steps
    limit = nh.systems[case.system].surface_limit
    exact = bounded_run(
        method, formulas(case.system, limit), (case.q0, case.p0), tau, case.steps, case.precision, case.summation
    )
    assert run.steps.item() == case.steps
    errors, bounds = np.array([float(abs(x)) for x in exact.errors]), np.array(exact.error_bounds)
    known = len(errors) - 1 - exact.lost
    assert_left(run, method, errors, bounds, limit, known)
    marks = np.rint(run.t.values / float(tau)).astype(int)
    assert_even(marks, case)
    for sample, n in enumerate(marks):
        if n > known or (run.diverged_at.item() and n >= run.diverged_at.item()):
            break
        assert run.t[sample].item() == pytest.approx(float(n * tau), rel=4e-16)
        found = digits_of(run, "q", sample) + digits_of(run, "p", sample)
        for x, y, bound in zip(found, exact.states[n], exact.bounds[n], strict=True):
            assert abs(x - y) <= bound + abs(y) * mpf(2) ** -104, (n, float(x - y), bound)
        signed = float(mpf(run.energy_error[sample].item()) - exact.errors[n])
        assert abs(signed) <= bounds[n] + 4e-16 * errors[n], (n, signed, bounds[n])
    return known == case.steps or bool(run.diverged_at.item())


def assert_left(run, method, errors, bounds, limit, known):
    """A run leaves at a step at which it can leave, and not later than it must; else its errors agree with mpmath."""
    left = run.diverged_at.item()
    may = np.flatnonzero(errors[: known + 1] + bounds[: known + 1] > limit)
    must = np.flatnonzero(errors - bounds > limit)
    assert (run.status.item() == "diverged") == (left > 0) == np.isinf(run.max_energy_error.item())
    done = left or run.steps.item()
    assert run.evaluations.item() == done * method.stages + (method.first == "kick")
    if left:
        assert left >= (may[0] if may.size else known + 1)
    if must.size and must[0] <= known:
        assert 0 < left <= must[0]
    if not left and known == run.steps.item():
        slack = bounds[1:].max() + 4e-16 * errors.max()
        assert abs(run.max_energy_error.item() - errors[1:].max()) <= slack
        assert abs(run.mean_energy_error.item() - errors[1:].mean()) <= slack


def assert_even(marks, case):
    """Samples from the first step to the last, evenly spaced to a step; a single sample is the end."""
    assert len(marks) <= max(1 if case.samples == 1 else 2, min(case.samples, case.steps + 1))
    if len(marks) > 1:
        gaps = np.diff(marks)
        assert marks[0] == 0
        assert 1 <= gaps.min() <= gaps.max() <= gaps.min() + 1


def assert_same_bits(case, run, monkeypatch):
    """The run beside other step sizes in shards, in lanes of the width asked for, and among members on threads."""
    order = random.Random(case.t_end)
    taus = order.sample([*case.taus, case.tau], len(case.taus) + 1)
    assert_equal(in_shards(case, taus), run, ("max_energy_error", "diverged_at", "evaluations"))
    assert_equal(in_lanes(case, taus, run.sizes["sample"]), run, (*STATES, "max_energy_error", "diverged_at"))
    monkeypatch.setattr(ensemble, "BLOCK", 2)
    member = among_members(case, order.randrange(5))
    assert_equal(member.isel(sample=slice(run.sizes["sample"])), run, (*STATES, "max_energy_error", "diverged_at"))


def in_shards(case, taus):
    """The run in a sweep over its part of the step sizes."""
    parts = [taus[i :: case.shards] for i in range(case.shards) if case.tau in taus[i :: case.shards]]
    swept = nh.sweep(case.system, case.integrator, parts[0], q0=case.q0, p0=case.p0, **case.settings)
    return swept.isel(tau=parts[0].index(case.tau))


def in_lanes(case, taus, samples):
    """The run in lanes beside the other step sizes."""
    plain = (case.precision, case.summation) == ("double", "plain")
    start = start_row(*(tuple(map(Fraction, half)) for half in (case.q0, case.p0)), plain=plain)
    found = integrate_batch(
        nh.systems[case.system], case.method, t_end=Fraction(case.t_end), start=start[None, :], samples=case.samples,
        steps=[max(1, round(abs(Fraction(case.t_end)) / Fraction(tau))) for tau in taus],
        numerics=Numerics(precision=case.precision, summation=case.summation, width=case.width),
    )  # fmt: skip
    i = taus.index(case.tau)
    alone = {name: getattr(found, name)[i][:samples] for name in STATES}
    return alone | {"max_energy_error": found.max_energy_error[i], "diverged_at": found.left_at[i]}


def among_members(case, place):
    """The run among four others, in blocks of two members."""
    q0 = [case.q0 if k == place else [str(Fraction(x) * (k + 9) / 10) for x in case.q0] for k in range(5)]
    many = nh.ensemble(
        case.system, case.integrator, case.tau, q0=q0, p0=[case.p0] * 5, threads=case.threads, samples=case.samples,
        **case.settings,
    )  # fmt: skip
    return many.isel(member=place)


def assert_equal(found, expected, names):
    for name in names:
        np.testing.assert_array_equal(found[name], expected[name], name)


def integrated(case):
    return nh.integrate(
        case.system, case.integrator, case.tau, samples=case.samples, q0=case.q0, p0=case.p0, **case.settings
    )


def tried(kind, cases, monkeypatch):
    compared = []
    for case in cases:
        with kind.case(case):
            run = integrated(case)
            compared.append(assert_bounded(case, run))
            assert_same_bits(case, run, monkeypatch)
    # Bounds of the others say nothing about their last steps.
    assert sum(compared) >= 0.8 * len(compared)


@pytest.mark.filterwarnings("ignore:taus?.* runs as")
def test_random_runs_are_those_of_mpmath_to_rounding(trials, monkeypatch):
    few = {"most_steps": 12, "most_stages": 7, "widths": (8,), "systems": ("sho", "henon_heiles", "kepler")}
    tried(trials("G. random runs against mpmath"), [random_case(seed, **few) for seed in range(12)], monkeypatch)


@pytest.mark.filterwarnings("ignore:taus?.* runs as")
@pytest.mark.parametrize(("precision", "fault"), [("double", 2.0**-40), ("extended", 2.0**-90)])
def test_a_coefficient_with_a_wrong_digit_is_outside_the_bound(precision, fault):
    """Bounds of twelve steps are a thousand roundings of a step wide at most."""
    case = replace(random_case(0, most_steps=12), precision=precision, samples=1000)
    assert_bounded(case, integrated(case))
    wrong = integrated(replace(case, t_end=str(Decimal(case.t_end) * (1 + Decimal(fault)))))
    with pytest.raises(AssertionError):
        assert_bounded(case, wrong.assign(t=integrated(case).t))


@pytest.mark.filterwarnings("ignore:taus?.* runs as")
@pytest.mark.long
def test_many_random_runs_are_those_of_mpmath_to_rounding(trials, monkeypatch):
    """500 runs: five minutes."""
    cases = [random_case(seed, most_steps=150) for seed in range(1000, 1500)]
    tried(trials("G. random runs against mpmath"), cases, monkeypatch)


# --- Systems and machine code that are no longer used are freed, and those that a call still needs are not


def used(name):
    """A system that every public function has used."""
    made = spring(name, frequencies=("1",), invariants={"H": lambda q, p: (q[0] ** 2 + p[0] ** 2) / 2})
    nh.integrate(made, "ruth", 0.5)
    nh.integrate(made, "ruth", 0.5, split="exact_oscillator")
    nh.sweep(made, "leapfrog", [0.5, 1.0])
    nh.ensemble(made, "ruth", 0.5, q0=[[1.0], [2.0]])
    nh.problem(made, "ruth")(0.5)
    return made


def test_a_system_that_is_no_longer_used_is_freed():
    """Except the last one, whose formulas are known until the next formulas are."""
    known = [weakref.ref(used(name)) for name in ("one", "two", "three")]
    gc.collect()
    assert [one() is None for one in known[:2]] == [True, True]


def prepared(system):
    """A batch of one step that is ready to run."""
    setup = Setup(system, "ruth", t_end=1)
    start, parameters = standard_start(system, False)[None, :].copy(), standard_parameters(system)[None, :]
    return setup.batch(setup.moves([setup.end]), single_steps(1), np.zeros(1, np.int64), start, parameters)


def test_a_prepared_batch_outlives_the_system_it_was_made_for():
    batch, other = prepared(spring("shortlived")), prepared(nh.systems["sho"])
    used("next")
    gc.collect()
    for one in (batch, other):
        one.run()
    assert np.array_equal(batch.filled.states, other.filled.states)
    assert batch.filled.states[0, 1, 0] != 1.0


@pytest.mark.slow
def test_a_stepper_outlives_the_system_it_was_made_for():
    step = nh.stepper(spring("shortlived"), "ruth", summation="plain")
    used("next")
    gc.collect()
    q, p = np.array([1.0]), np.array([0.0])
    step(q, p, 0.5)
    run = nh.integrate("sho", "ruth", 0.5, t_end=0.5, summation="plain")
    assert (q[0], p[0]) == (run.q[-1, 0].item(), run.p[-1, 0].item())


def test_results_are_remembered_by_the_system_itself():
    asked = []

    @remembered
    def doubled(system, number, *, more=0):
        asked.append(system.name)
        return 2 * number + more

    one, two = spring("one"), spring("two")
    assert [doubled(one, 1), doubled(two, 1), doubled(one, 1), doubled(one, 1, more=1)] == [2, 2, 2, 3]
    assert (asked, doubled.misses) == (["one", "two", "one"], 3)
    del two
    gc.collect()
    assert doubled.misses == 2
    doubled.cache_clear()
    assert (doubled(one, 1), asked[3:]) == (2, ["one"])


#: KiB that the memory of a process grows by for each of 40 systems that are used and dropped.
GROWTH = """
import gc
import psutil
import nearharmonic as nh
memory = psutil.Process().memory_info
for k in range(60):
    if k == 20:
        before = gc.collect() * 0 + memory().rss
    one = nh.System(name=f"number {k}", V=lambda q, a=k % 3 + 1: a * q[0] ** 2 / 2, q0=["1"], p0=["0"], t_end="1")
    nh.integrate(one, "ruth", 0.5)
    del one
gc.collect()
print((memory().rss - before) / 1024 / 40)
"""


@pytest.mark.slow
def test_sixty_dropped_systems_leave_no_memory_behind():
    """A kernel and its engine take 300 KiB; the allocator keeps 40 KiB of the memory that is freed."""
    found = subprocess.run([sys.executable, "-c", GROWTH], check=True, capture_output=True, text=True, timeout=300)
    assert float(found.stdout) < 100
