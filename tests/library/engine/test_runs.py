"""Prepared problems and ensembles: the bits of single runs, whatever the threads, the width and the company."""

import fcntl
import os
import pickle
import pty
import signal
import struct
import subprocess
import sys
import termios
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from psutil import Process

import nearharmonic as nh
from nearharmonic.engine import ensemble as module
from nearharmonic.engine.kernels import kernel_of, with_lanes
from nearharmonic.engine.settings import Numerics
from nearharmonic.engine.trajectory import warm_up
from nearharmonic.errors import NearharmonicError
from support.methods.own_systems import spring

STARTS = np.random.default_rng(5).uniform(-0.3, 0.3, (21, 4))


def test_parameters_of_one_call_do_not_reach_the_next():
    problem = nh.problem("kepler", "ruth", t_end=4000)
    own, other, again = problem(100), problem(100, parameters={"GM": 1.6}), problem(100)
    assert np.array_equal(own.q, again.q)
    assert not np.array_equal(own.q, other.q)
    with pytest.raises(NearharmonicError):
        problem(100, q0=(50.0, 0.0), parameters={"GM": "x"})
    assert np.array_equal(problem(100).q, own.q)


def test_a_prepared_run_that_diverges_says_so():
    found = nh.problem("henon_heiles", "ruth")(3.0)
    assert (found.status, found.max_energy_error, len(found.q)) == ("diverged", np.inf, 1)
    assert "diverged" in repr(found)


def test_states_are_read_without_energies_and_are_the_readers_own():
    found = nh.problem("kepler", "srkn_a14", t_end=4000, energy="none", samples=5)(100)
    q, p = found.q, found.p
    assert "trajectories" not in vars(found)  # which holds the energies
    assert np.array_equal(q, found.trajectories.q[0])
    assert np.array_equal(p, found.trajectories.p[0])
    q[:] = 0
    assert np.array_equal(found.q, found.trajectories.q[0])
    assert found.q.any()


def test_plunge_without_energies_causes_one_warning():
    start = {"q0": [46, 0], "p0": [0, "0.001"]}
    with pytest.warns(UserWarning, match="checks nothing: at the end H is off by") as caught:
        run = nh.integrate("kepler", "leapfrog", 1, t_end=4000, energy="none", samples=1, **start)
    gm = 1.71994752  # of Nielsen's units
    first = -gm / 46 + 5e-7
    change = run.p.values[-1] @ run.p.values[-1] / 2 - gm / np.hypot(*run.q.values[-1]) - first
    assert len(caught) == 1
    assert f"off by {change:.2g}, and H0 = {first:.2g}" in str(caught[0].message)
    nh.integrate("kepler", "leapfrog", 40, t_end=4000, energy="none")  # no warning, which would be an error


def test_a_problem_and_its_copy_show_system_and_method():
    problem = nh.problem("kepler", "srkn_a14", t_end=4000, energy="samples", samples=5)
    copy = pickle.loads(pickle.dumps(problem))
    assert repr(copy) == repr(problem) == "Problem('kepler', 'srkn_a14', t_end=4000)"
    assert copy(100).q.shape == (5, 2)


@pytest.mark.slow
def test_result_of_system_in_file_is_read_in_another_process(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from nearharmonic import System\n"
        "SYSTEM = System(name='mine', V=lambda q: q[0]**2 / 2 + q[0]**4, q0=['1'], p0=['0'], t_end=1)\n"
    )
    result = nh.problem(str(path), "leapfrog")(0.1)
    (tmp_path / "result.pickle").write_bytes(pickle.dumps(result))
    read = "import pickle, sys; r = pickle.load(open(sys.argv[1], 'rb')); print(r.problem(0.1).q[-1, 0], r.q[-1, 0])"
    told = subprocess.run(
        [sys.executable, "-c", read, "result.pickle"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == [str(result.q[-1, 0])] * 2


def test_one_problem_serves_several_threads():
    problem = nh.problem("henon_heiles", "aba864", t_end=50)
    expected = [problem(0.05, q0=row[:2], p0=row[2:]).q for row in STARTS]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda row: problem(0.05, q0=row[:2], p0=row[2:]).q, np.concatenate([STARTS] * 20)))
    assert all(np.array_equal(a, expected[i % len(STARTS)]) for i, a in enumerate(found))


def test_bits_do_not_depend_on_threads_blocks_or_width(monkeypatch):
    rows = np.random.default_rng(6).uniform(-0.3, 0.3, (300, 4))
    given = {"q0": rows[:, :2], "p0": rows[:, 2:], "t_end": 100}
    expected = nh.ensemble("henon_heiles", "ruth", 0.1, **given)
    at_times = nh.ensemble("henon_heiles", "ruth", 0.1, t=[2.25, 50, 100], **given)
    monkeypatch.setattr(module, "BLOCK", 32)
    monkeypatch.setattr("nearharmonic.engine.batch.SHORT", 0)
    for threads in (1, 2, 5):
        assert nh.ensemble("henon_heiles", "ruth", 0.1, threads=threads, **given).identical(expected)
        found = nh.ensemble("henon_heiles", "ruth", 0.1, threads=threads, t=[2.25, 50, 100], **given)
        assert found.identical(at_times)
    monkeypatch.setattr(module, "most_lanes_of", lambda *_: 4)
    assert nh.ensemble("henon_heiles", "ruth", 0.1, **given).identical(expected)


@pytest.mark.parametrize(("system", "precision"), [("sho", "double"), ("sho", "extended"), ("kepler", "double")])
def test_kernels_that_are_compiled_ahead_are_those_of_sweeps(system, precision):
    steps = (1e6 * 10.0 ** (-np.arange(80) / 40)).astype(np.int64)
    warm_up(system, [precision])
    known = kernel_of.misses
    kernel_of(
        nh.systems[system], with_lanes(Numerics(precision=precision), steps, nh.systems[system], nh.integrators["ruth"])
    )
    assert kernel_of.misses == known


def test_a_member_that_leaves_leaves_alone():
    q0 = np.array([[0.3, 0.0], [3.0, 3.0], [0.1, 0.1]])
    many = nh.ensemble("henon_heiles", "ruth", 0.3, q0=q0, t_end=50)
    assert many.status.values.tolist() == ["ok", "diverged", "ok"]
    assert np.isnan(many.q[1, -1]).all()
    assert np.isinf(many.max_energy_error[1])
    assert many.max_energy_error[0] == nh.integrate("henon_heiles", "ruth", 0.3, q0=q0[0], t_end=50).max_energy_error


def test_an_ensemble_keeps_what_was_asked_for():
    last = nh.ensemble("henon_heiles", "ruth", 0.1, q0=STARTS[:, :2], t_end=5, samples=1)
    both = nh.ensemble("henon_heiles", "ruth", 0.1, q0=STARTS[:, :2], t_end=5)
    times = nh.ensemble("henon_heiles", "ruth", 0.1, q0=STARTS[:, :2], t_end=5, t=[2.25, 5])
    assert np.array_equal(last.q[:, 0], both.q[:, 1])
    assert np.array_equal(times.q[:, 1], both.q[:, 1])
    single = nh.integrate("henon_heiles", "ruth", 0.1, q0=STARTS[7, :2], t_end=5, t=[2.25])
    assert np.array_equal(times.q[7, 0], single.q[0])


def test_a_result_knows_the_parameters_that_it_was_computed_with():
    """Its invariants, runs that continue from it, and its description use its own parameters."""
    spring = nh.System(
        name="spring of a constant",
        V=lambda q, k: k * q[0] ** 2 / 2,
        q0=("1",),
        p0=("0",),
        t_end="2",
        parameters={"k": "1"},
        invariants={"twice_the_energy": lambda q, p, k: k * q[0] ** 2 + p[0] ** 2},
    )
    problem = nh.problem(spring, "leapfrog", samples=5)
    for value in ("4", np.float32(0.1), np.array(2.5), [0.3]):
        given = {"q0": [1.5], "parameters": {"k": value}}
        result, single = problem(0.1, **given).to_dataset(), nh.integrate(spring, "leapfrog", 0.1, samples=5, **given)
        assert result.identical(single)
        assert result.twice_the_energy.values[0] == pytest.approx(2 * result.initial_energy.item(), rel=1e-15)
        whole = nh.integrate(spring, "leapfrog", 0.1, t_end=4, **given)
        rest = nh.integrate(spring, "leapfrog", 0.1, start=result)
        assert np.array_equal(rest.q.values[-1], whole.q.values[-1])
        assert np.array_equal(rest.q_low.values[-1], whole.q_low.values[-1])
        whole_drift = nh.integrate(spring, "leapfrog", 0.1, **given).twice_the_energy_drift
        assert nh.integrate(spring, "leapfrog", 0.1, samples=1, **given).twice_the_energy_drift.item() > 0
        assert nh.integrate(spring, "leapfrog", 0.1, t=[0.5, 2], **given).twice_the_energy_drift <= whole_drift
    # Members of energy 0 are measured absolutely, and the Dataset says so of them alone.
    some = nh.ensemble(spring, "leapfrog", 0.1, q0=np.array([[0.0], [2.0]])).max_energy_error
    none = nh.ensemble(spring, "leapfrog", 0.1, q0=np.array([[0.0], [0.0]])).max_energy_error
    assert "|H - H0|/|H0| (absolute, in 1, where H0 = 0)" in some.long_name
    assert "|H - H0| over" in none.long_name
    assert some.values[1] == nh.integrate(spring, "leapfrog", 0.1, q0=[2.0]).max_energy_error


def test_parameters_that_are_compiled_in_serve_ensembles_too():
    """A power that the formula branches on; two blocks of members, and values that are refused."""
    system = nh.System(
        name="power", V=lambda q, n: q[0] ** 4 / 4 if n > 2 else q[0] ** 2 / 2, q0=["1"], p0=["0"], t_end="1",
        parameters={"n": "4"},
    )  # fmt: skip
    q0 = np.linspace(0.5, 1, module.BLOCK + 3)[:, None]
    members = nh.ensemble(system, "leapfrog", 0.1, q0=q0, threads=1)
    for i in (0, module.BLOCK, module.BLOCK + 2):
        assert np.array_equal(members.q[i], nh.integrate(system, "leapfrog", 0.1, q0=q0[i]).q[[0, -1]])
    own, given = (nh.integrate(system, "leapfrog", 0.1, parameters=x) for x in (None, {"n": "4"}))
    assert own.max_energy_error == given.max_energy_error
    with pytest.raises(NearharmonicError, match="they are compiled in"):
        nh.ensemble(system, "leapfrog", 0.1, q0=q0, parameters={"n": "2"})
    with pytest.raises(NearharmonicError, match=r"parameters = \[5\.0\].*compiled in.*dataclasses\.replace"):
        nh.integrate(system, "leapfrog", 0.1, parameters={"n": 5})


LONG = """
import sys, time, nearharmonic as nh
nh.sweep("sho", "ruth", [1.0]); nh.ensemble("sho", "ruth", 1.0, q0=[["1"], ["2"]], t_end=10)
print("ready", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print(f"stopped {{time.process_time()}}", flush=True)
"""


@pytest.mark.parametrize(
    "call",
    [
        'nh.integrate("sho", "ruth", 1e-5, t_end=9000)',
        pytest.param(
            'nh.ensemble("sho", "ruth", 1e-4, q0=[[str(i + 1)] for i in range(3000)], t_end=1000, threads=2)',
            marks=pytest.mark.slow,
        ),
    ],
    ids=["one long run", "an ensemble on threads"],
)
def test_keyboard_stops_run_within_fraction_of_second(call):
    """0.2 s at any length; of the time of the process, on two cores at most, which no other process prolongs."""
    source = str(Path(nh.__file__).parents[1])
    command = [sys.executable, "-c", LONG.format(call=call)]
    environment = {**os.environ, "PYTHONPATH": source}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        assert process.poll() is None
        own = Process(process.pid).cpu_times()
        process.send_signal(signal.SIGINT)
        told, spent = process.stdout.readline().split()
        assert told == "stopped"
        assert float(spent) - (own.user + own.system) < 1


# --- Initial values, parameters and output times at run time, backward and continued runs: the bits they must have


def same(a, b, names=("q", "p", "energy_error", "max_energy_error")):
    return all(np.array_equal(a[name].values, b[name].values, equal_nan=True) for name in names)


@pytest.mark.parametrize("precision", ["double", "extended"])
def test_run_time_values_give_bits_of_system_with_them(precision):
    """Strings and fractions exactly, to the digits below a double."""
    kepler = nh.systems["kepler"]
    GM = replace(kepler.parameters["GM"], value="1.7")
    own = replace(kepler, q0=("69.1", "0.3"), p0=("0", "0.14"), parameters={"GM": GM})
    expected = nh.integrate(own, "aba864", 200, t_end=4000, precision=precision)
    for q0, p0, value in (
        (("69.1", "0.3"), ("0", "0.14"), "1.7"),
        ((Fraction(691, 10), Decimal("0.3")), ("0", Fraction(7, 50)), Fraction(17, 10)),
        (["691/10", "3e-1"], [0, "0.14"], Decimal("1.7")),
    ):
        given = {"q0": q0, "p0": p0, "parameters": {"GM": value}}
        found = nh.integrate("kepler", "aba864", 200, t_end=4000, precision=precision, **given)
        assert same(found, expected)
        swept = nh.sweep("kepler", "aba864", [200, 100], t_end=4000, precision=precision, **given)
        assert swept.max_energy_error[0] == expected.max_energy_error


def test_floats_mean_their_binary_value():
    exact = [f"{x:.60f}" for x in (0.3, 0.4)]  # all digits of the doubles, which 0.3 and 0.4 are not
    a = nh.integrate("henon_heiles", "ruth", 0.1, t_end=5, q0=np.array([0.3, 0.0]), p0=(0.0, 0.4))
    b = nh.integrate("henon_heiles", "ruth", 0.1, t_end=5, q0=(exact[0], "0"), p0=("0", exact[1]))
    c = nh.integrate("henon_heiles", "ruth", 0.1, t_end=5)
    assert same(a, b)
    assert a.q_low[0, 0] == 0 != c.q_low[0, 0]


def test_new_values_compile_nothing():
    nh.sweep("kepler", "aba864", [200], t_end=4000)
    before = kernel_of.misses
    for value in ("1.6", 1.65, "17/10"):
        nh.sweep("kepler", "aba864", [200], t_end=4000, parameters={"GM": value}, q0=(70.0, value))
    assert kernel_of.misses == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", sorted(name for name, one in nh.integrators.items() if one.symmetric and not one.processed)
)
def test_a_run_backwards_returns_to_the_start(method):
    """Symmetric methods: -tau undoes tau, up to 2 * 200 stages of 2e-32 grown by less than 1e3. Ruth's map alone is
    not symmetric: there the way back has the error of a method of order four."""
    out = nh.integrate("henon_heiles", method, 0.2, t_end=4, precision="extended")
    back = nh.integrate("henon_heiles", method, 0.2, t_end=-4, precision="extended", start=out)
    defect = np.abs((back.q[-1] - out.q[0]) + (back.q_low[-1] - out.q_low[0])).max()
    assert defect < 1e-25
    assert (back.t[0], back.t[-1]) == (4, 0)


def test_output_times_on_steps_are_the_samples_of_the_run():
    run = nh.integrate("henon_heiles", "aba864", 0.25, t_end=10, samples=41)
    found = nh.integrate("henon_heiles", "aba864", 0.25, t_end=10, t=run.t.values)
    assert same(found, run)


@pytest.mark.parametrize("how", [{}, {"summation": "plain"}, {"precision": "extended"}], ids=["carry", "plain", "dd"])
@pytest.mark.parametrize("method", ["aba864", "babps9o7h"])
def test_between_two_steps_lies_one_shorter_step_from_step_before(method, how):
    """The step is computed by hand: a run of one step from the state of the step before, to 1/3 of a step."""
    asked = [0, Fraction(1, 12), 3, Fraction(37, 12), Fraction(37, 12), "10"]
    found = nh.integrate("henon_heiles", method, 0.25, t_end=10, t=asked, **how)
    whole = nh.integrate("henon_heiles", method, 0.25, t_end=3, samples=2, **how)
    step = nh.integrate("henon_heiles", method, 1 / 12, t_end=1 / 12, start=whole, samples=2, **how)
    assert np.array_equal(found.q[2], whole.q[-1])
    # 1/12 as a double differs from 1/12 by 5e-18.
    assert np.abs(found.q[3] - step.q[-1]).max() < 1e-15
    assert np.array_equal(found.q[3], found.q[4])
    assert np.abs(found.energy_error[3] - step.energy_error[-1]) < 1e-15
    assert np.abs(found.q[3] - whole.q[-1]).max() > 1e-3
    end = nh.integrate("henon_heiles", method, 0.25, t_end=10, samples=2, **how)
    assert np.array_equal(found.q[-1], end.q[-1])
    assert found.max_energy_error == end.max_energy_error


@pytest.mark.parametrize("sign", [1, -1])
def test_state_between_steps_is_shorter_step_from_one_before(sign):
    between = nh.integrate("henon_heiles", "ruth", 0.5, t_end=5 * sign, t=[2.45 * sign])
    before = nh.integrate("henon_heiles", "ruth", 0.5, t_end=2 * sign)
    shorter = nh.integrate("henon_heiles", "ruth", 0.45, t_end=0.45 * sign, start=before)
    behind = nh.integrate("henon_heiles", "ruth", 0.5, t_end=2.5 * sign)
    backwards = nh.integrate("henon_heiles", "ruth", 0.05, t_end=-0.05 * sign, start=behind)
    assert np.abs(between.q[-1] - shorter.q[-1]).max() < 1e-14
    assert np.abs(between.q[-1] - backwards.q[-1]).max() > 1e-6


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("t_end", "times"), [
    ("0.1", np.linspace(0, 0.1, 11, dtype=np.float32)), ("0.7", np.linspace(0, 0.7, 8, dtype=np.float32)),
    (0.3, [0, 0.1 * 3]), (0.3, [0, 0.3 - 2.0**-54]), (1e-3, np.array([0, 1e-3], np.float16)),
])  # fmt: skip
def test_time_within_a_rounding_of_the_end_is_the_end(t_end, times, sign):
    """float32 of 0.1 is above it and of 0.7 below it, and 0.1 * 3 is the double behind 0.3."""
    assert abs(float(times[-1]) - float(t_end)) > 0
    found, run = (
        nh.integrate("sho", "ruth", float(t_end) / 10, t_end=sign * float(t_end), **given)
        for given in ({"t": [sign * x for x in times]}, {"samples": 2})
    )
    assert found.t[-1] == sign * float(t_end)
    assert np.array_equal(found.q[-1], run.q[-1])
    assert "running" in found


@pytest.mark.parametrize(
    ("times", "more"),
    [([0, 0.3 + 2.0**-52], ""), (np.array([0, 0.3 + 2.0**-21], np.float32), "; float32 has 6 digits")],
)
def test_a_time_behind_the_end_is_refused_with_its_type(times, more):
    with pytest.raises(NearharmonicError, match=f"is not allowed: a time from 0 to t_end = 0.3{more}$"):
        nh.integrate("sho", "ruth", 0.1, t_end=0.3, t=times)


CALLS = {
    "integrate": lambda tau: nh.integrate("sho", "ruth", tau, t_end=1),
    "integrate backwards": lambda tau: nh.integrate("sho", "ruth", tau, t_end=-1),
    "ensemble": lambda tau: nh.ensemble("sho", "ruth", tau, q0=[[1], [2]], t_end=1),
    "tangent": lambda tau: nh.tangent("sho", "ruth", tau, t_end=1),
    "gradient": lambda tau: nh.gradient("sho", "ruth", tau, lambda q, p: q[0], t_end=1),
    "section": lambda tau: nh.section("sho", "ruth", tau, surface=0, t_end=1),
    "problem": lambda tau: nh.problem("sho", "ruth", t_end=1)(tau).to_dataset(),
}


@pytest.mark.parametrize(
    "call", [pytest.param(x, marks=[pytest.mark.slow] * (key == "section")) for key, x in CALLS.items()], ids=CALLS
)
def test_step_one_percent_off_is_warned_of_where_asked(call):
    """1/0.0099 = 101.01 are 101 steps, off by 0.01 %. The warning is of the line that calls."""
    with pytest.warns(
        UserWarning, match="^tau = 0.66 runs as 0.5: t_end = -?1 is no multiple .* by 2 equal steps$"
    ) as told:
        found = call(0.66)
    assert [one.filename for one in told] == [__file__]
    assert (found.tau_requested, abs(found.tau)) == (0.66, 0.5)
    assert call("0.0099").tau_requested == 0.0099


def test_a_sweep_names_the_worst_of_its_steps():
    with pytest.warns(UserWarning, match=r"^taus\[1\] = 0.7 runs as 1: ") as told:
        nh.sweep("sho", "ruth", [0.1, 0.7, 0.3], t_end=1)
    assert [one.filename for one in told] == [__file__]


def test_a_truth_value_is_no_step_of_a_prepared_run():
    run = nh.problem("sho", "ruth", t_end=1)
    assert run(1.0).tau_requested == 1
    with pytest.raises(NearharmonicError, match="tau = True is not allowed"):
        run(True)


def test_energy_errors_at_output_times_are_exact():
    """H of states between two steps in rational numbers; without the low half of H0 errors are off by 1e-7."""

    def H(x, y, px, py):
        return (x * x + y * y + px * px + py * py) / 2 + x * x * y - y**3 / 3

    q0, p0 = ["0.1", "0.3"], ["0.35", "-0.1"]
    run = nh.integrate("henon_heiles", "babps9o7h", 0.2, t_end=1, t=["0.3", "0.4", "0.9"], q0=q0, p0=p0)
    H0 = H(*map(Fraction, q0 + p0))
    for k, error in enumerate(run.energy_error.values):
        halves = (zip(run[x].values[k], run[f"{x}_low"].values[k], strict=True) for x in "qp")
        state = [Fraction(high) + Fraction(low) for pairs in halves for high, low in pairs]
        assert error == pytest.approx(float(H(*state) / H0 - 1), rel=1e-13, abs=0), "energy error at an output time"


def test_unmeasured_run_diverges_if_not_finite_sampled_at_first_sample():
    runs = {e: nh.integrate("henon_heiles", "ruth", 3.0, t_end=300, samples=11, energy=e)
            for e in ("every", "samples", "none")}  # fmt: skip
    assert {run.status.item() for run in runs.values()} == {"diverged"}
    assert runs["every"].diverged_at < runs["samples"].diverged_at == 10
    assert runs["none"].diverged_at.item() % 10 == 0
    assert np.isfinite(runs["none"].q).all()


def test_neighbours_of_run_do_not_change_its_sampled_errors():
    """Sixteen runs of different lengths in eight lanes, against each alone."""
    taus = [20 / n for n in range(40, 56)]
    for given in ({}, {"t": [5, 10, 20]}):
        together = nh.sweep("henon_heiles", "ruth", taus, t_end=20, energy="samples", **given)
        for i, tau in enumerate(taus):
            alone = nh.sweep("henon_heiles", "ruth", [tau], t_end=20, energy="samples", **given)
            assert together.max_energy_error[i] == alone.max_energy_error[0]


def test_energy_errors_are_relative_to_scale_that_is_asked_for():
    """H0 = 1/8 of the Hénon-Heiles start."""
    own = nh.integrate("henon_heiles", "ruth", 0.3, t_end=20)
    scaled = nh.integrate("henon_heiles", "ruth", 0.3, t_end=20, energy_scale="0.25")
    assert scaled.max_energy_error.item() == own.max_energy_error.item() / 2
    assert "/(0.25 1)" in scaled.max_energy_error.long_name
    declared = replace(nh.systems["henon_heiles"], energy_scale="0.25")
    assert nh.integrate(declared, "ruth", 0.3, t_end=20).max_energy_error == scaled.max_energy_error


def test_zero_energy_has_its_unit_and_dataset_states_it():
    units = {"q": "m", "p": "kg m s-1", "t": "s", "energy": "J"}
    hill = spring("hill", V=lambda q: -q[0] * q[0] / 2, grad_V=lambda q: (-q[0],), p0=("1",), t_end="3", units=units)
    run = nh.integrate(hill, "yoshida_s7o6a", 0.15)
    assert run.max_energy_error.units == run.energy_error.units == "J"
    assert "/|H0|" not in run.max_energy_error.long_name
    assert 0 < run.max_energy_error < 1e-3


def test_a_result_that_cannot_be_continued_is_refused():
    lost, other = nh.integrate("henon_heiles", "ruth", 3.0), nh.integrate("sho", "ruth", 0.1)
    for start, words in ((lost, "diverged at step"), (other, "a result of sho")):
        with pytest.raises(NearharmonicError, match=words):
            nh.integrate("henon_heiles", "ruth", 0.1, start=start)
    sound = nh.integrate("henon_heiles", "ruth", 0.1, t_end=1)
    with pytest.raises(NearharmonicError, match="continues from the state of that result"):
        nh.integrate("henon_heiles", "ruth", 0.1, start=sound, p0=(0, 0))


# --- Progress of a long run: on a terminal, and nowhere else


LONG_OF_PROGRESS = """
import nearharmonic as nh
from nearharmonic.engine import batch
nh.sweep("sho", "ruth", [1.0])
batch.LONG = 0.1
nh.integrate("sho", "ruth", 1e-5, t_end=200)
"""


def run(stderr):
    environment = {**os.environ, "PYTHONPATH": str(Path(nh.__file__).parents[1])}
    return subprocess.run(
        [sys.executable, "-c", LONG_OF_PROGRESS], stderr=stderr, stdin=subprocess.DEVNULL, env=environment, check=True
    )


@pytest.mark.slow
def test_a_long_run_shows_its_progress_on_a_terminal():
    """A terminal of 24 by 80; the bar counts steps, and is wiped off at the end."""
    reader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    run(terminal)
    os.close(terminal)
    shown = b""
    with suppress(OSError):  # the end of a terminal
        while chunk := os.read(reader, 65536):
            shown += chunk
    os.close(reader)
    assert b"20.0M" in shown
    assert b"steps/s" in shown
    assert shown.endswith(b" \r")


@pytest.mark.slow
def test_nothing_is_written_where_there_is_no_terminal():
    assert run(subprocess.PIPE).stderr == b""
