"""Prepared problems and ensembles: the bits of single runs, whatever the threads, the width and the company."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from psutil import Process

import nearharmonic as nh
from nearharmonic.engine import ensemble as module
from nearharmonic.engine.kernels import lanes_for, most_lanes
from nearharmonic.errors import NearharmonicError

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


def test_the_width_leaves_half_of_the_registers_to_the_force():
    """d coordinates hold 4 d doubles a lane with carries; 16 registers of eight lanes."""
    assert most_lanes(1, compensated=True, extended=False) == 32
    assert most_lanes(2, compensated=True, extended=False) == 16
    assert most_lanes(2, compensated=False, extended=False) == 32
    assert most_lanes(6, compensated=True, extended=False) == 8
    assert most_lanes(2, compensated=True, extended=True) == 8


def test_one_run_takes_one_lane_and_many_take_useful_lanes():
    """A queue takes max(longest, total / lanes) steps, one of 1.2, 2.0 or 3.6 times a single run's."""
    equal = np.full(64, 100)
    assert lanes_for(np.array([1000]), 32) == 1
    assert lanes_for(equal, 8) == 8  # 800 steps of 1.2 against 6400
    assert lanes_for(equal, 16) == 16  # 400 of 2.0 = 800 against 960
    assert lanes_for(equal, 32) == 32  # 200 of 3.6 = 720
    assert lanes_for(np.array([10000, 10, 10]), 32) == 1  # 10020 against 12000
    assert lanes_for(np.array([100, 100]), 32) == 8  # 120 against 200


def test_a_result_knows_the_parameters_that_it_was_computed_with():
    """Invariants, what continues from it, and its description are those of its own parameters."""
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
