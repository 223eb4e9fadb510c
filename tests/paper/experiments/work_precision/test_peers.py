"""Other libraries on equal systems: messages for missing ones, fair timing, and errors against closed forms."""

from __future__ import annotations

import dataclasses
import sys
from fractions import Fraction
from math import inf, sqrt

import numpy as np
import pytest
from mpmath import mpf

from nearharmonic.engine.reference import reference
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.integrators import integrators
from nearharmonic.recommendation.measure import Interval
from nearharmonic.systems import System, systems
from nearharmonic.systems.gradients import velocity, velocity_text
from nearharmonic_paper.experiments.work_precision.peers import (
    LIBRARIES,
    PEERS,
    Attempt,
    Peer,
    is_installed,
    missing,
    numpy_splitting,
)
from nearharmonic_paper.experiments.work_precision.run import (
    WorkPrecisionSettings,
    energy_errors,
    measured_peer,
)
from support.oracles.reference_solutions import oscillator_state

RELATIVISTIC = System(
    name="fast",
    label="fast",
    V=lambda q: q[0] * q[0] / 2,
    grad_V=lambda q: q,
    T=lambda p: (1 + p[0] * p[0]) ** 2,
    grad_T=lambda p: (4 * p[0] * (1 + p[0] * p[0]),),
    q0=("1",),
    p0=("0",),
    t_end="5",
    units={"q": "1", "p": "1", "t": "1", "energy": "1"},
    source="made up",
)


@pytest.mark.parametrize("library", [name for name in LIBRARIES if name != "numpy"])
def test_a_library_that_is_missing_is_named_not_skipped(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)  # what Python itself does to forbid an import
    monkeypatch.setenv("PATH", "")  # where compilers are looked for
    assert missing(library) == "not installed"
    for peer in PEERS.values():
        if peer.module == library:
            solver = measured_peer(peer, Interval(systems["kepler"], "5"), (0.1, 1.0), 1.0)
            assert (solver.method, solver.status, solver.settings) == (peer.name, "not installed", 0)
    assert is_installed("numpy")
    assert not is_installed("gcc")


def test_a_library_that_is_broken_says_how(monkeypatch, tmp_path):
    (tmp_path / "heyoka.py").write_text("raise ImportError('libsomething.so: cannot open')")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "heyoka", raising=False)
    assert missing("heyoka") == "cannot be imported: libsomething.so: cannot open"


def test_all_solvers_are_timed_unless_the_config_names_libraries():
    assert WorkPrecisionSettings().solvers() == list(PEERS)
    assert WorkPrecisionSettings(peers=("heyoka",)).solvers() == [n for n, p in PEERS.items() if p.module == "heyoka"]


def test_methods_in_numpy_end_where_the_matrix_power_ends():
    for name in ("aba864", "babps9o7h"):  # a drift first and a kick first
        states, evaluations = numpy_splitting(integrators[name])(systems["sho"], 5.0, 0.25).path()
        q, p = oscillator_state(integrators[name], mpf(5) / 20, 20)
        # 20 steps of up to 20 roundings of 1e-16 each.
        assert states[-1] == pytest.approx([float(q), float(p)], abs=400 * 1.2e-16)
        assert len(states) == 21
        assert evaluations == integrators[name].stages * 20 + 1


def test_what_is_timed_is_what_is_measured():
    attempt = numpy_splitting(integrators["aba864"])(systems["henon_heiles"], 5.0, 0.25)
    assert np.concatenate(attempt.run()).tolist() == attempt.path()[0][-1].tolist()


def test_energy_errors_are_taken_over_every_state_but_the_first():
    states = np.array([[1.0, 0.0], [1.0, 1.0], [2.0, 0.0]])  # H = 1/2, 1, 2
    assert energy_errors(systems["sho"], states) == (3.0, 2.0)
    assert energy_errors(systems["sho"], np.array([[1.0, 0.0], [np.nan, 0.0]])) == (inf, inf)


def test_the_written_velocity_is_hamiltons():
    for system in systems.values():
        if system.regularisation is not None:
            continue  # whose equations are those of other coordinates
        d = system.dimension
        q, p = (tuple(0.3 + 0.1 * i + shift for i in range(d)) for shift in (0.0, 0.5))
        constants = [float(Fraction(parameter.value)) for parameter in system.parameters.values()]
        expected = [*system.grad_T(p), *(-force for force in system.grad_V(q, *constants))]
        # The same operations in the same order: equal, but for how the constants fold.
        assert velocity(system)(*q, *p) == pytest.approx(expected, rel=4e-16)


def test_the_written_velocity_calls_the_functions_it_is_given():
    called = []
    made = velocity(systems["kepler"], {"sqrt": lambda x: called.append(x) or sqrt(x)})
    made(3.0, 4.0, 0.0, 0.0)
    assert called == [25.0]


def test_a_formula_that_branches_is_refused():
    forked = System(
        **{
            name: getattr(RELATIVISTIC, name) for name in ("name", "label", "V", "q0", "p0", "t_end", "units", "source")
        },
        grad_V=lambda q: q if q[0] else (0,),
    )
    with pytest.raises(SystemDefinitionError, match="fast: grad_V uses a value as a condition"):
        velocity_text(forked)


def fake(path, settings=(1e-2, 1e-4, 1e-6), **more):
    """A peer of numpy, which is always there, whose path is ``path(setting)``."""
    return Peer(
        name="fake", label="Fake", module="numpy", settings=settings,
        attempt=lambda system, t_end, setting: Attempt(run=lambda: None, path=lambda: path(setting)), **more,
    )  # fmt: skip


def oscillator_path(setting):
    return np.array([[1.0, 0.0], [1.0, sqrt(setting)]]), 7.0  # |dH/H0| = setting


def measured_sho(peer, longest=1.0, exact=None):
    return measured_peer(peer, Interval(systems["sho"], "5", exact), (0.1, 1.0), longest)


def test_each_setting_is_a_point_with_its_errors_and_cost():
    solver = measured_sho(fake(oscillator_path), exact=reference(systems["sho"], "5"))
    found = {name: solver.columns[name].tolist() for name in solver.columns}
    assert solver.status == "ok"
    assert found["tolerance"] == [1e-2, 1e-4, 1e-6]
    assert (found["evaluations"], found["steps"]) == ([7.0] * 3, [1] * 3)
    assert found["max_energy_error"] == pytest.approx([1e-2, 1e-4, 1e-6], rel=1e-9)
    assert found["position_error"] == pytest.approx([1 - np.cos(5.0)] * 3, rel=1e-14)
    assert list(solver.calls) == [("trajectory", i) for i in range(3)]


def test_failing_run_has_infinite_error_and_no_time():
    def path(setting):
        if setting > 1e-3:
            raise ZeroDivisionError
        return oscillator_path(setting)

    solver = measured_sho(fake(path))
    assert np.isfinite(solver.columns["max_energy_error"]).tolist() == [False, True, True]
    assert [i for _, i in solver.calls] == [1, 2]


def test_refining_ends_where_run_takes_too_long_and_says_so():
    def path(setting):
        if setting < 1e-3:
            raise TimeoutError
        return oscillator_path(setting)

    solver = measured_sho(fake(path), 0.5)
    assert solver.columns["tolerance"].tolist() == [1e-2]
    assert solver.status == "stopped where a run took longer than 0.5 s"


def test_long_diverging_coarse_run_does_not_end_refinement(monkeypatch):
    clock = iter(range(0, 100, 10))  # each path seems to take ten seconds
    monkeypatch.setattr("nearharmonic_paper.experiments.work_precision.run.time.perf_counter", lambda: next(clock))

    def path(setting):
        return oscillator_path(setting if setting < 1e-1 else inf)

    solver = measured_sho(fake(path, settings=(1.0, 1e-2, 1e-4)), 0.5)
    assert [solver.columns[name].tolist() for name in ("tolerance", "max_energy_error")] == [[1.0], [inf]]
    assert solver.status.startswith("stopped")


def test_refining_ends_where_rounding_takes_over():
    settings = (1e-6, 1e-12, 1e-12, 1e-13)
    assert measured_sho(fake(oscillator_path, settings=settings)).settings == 3


def test_peer_of_accelerations_is_refused_where_they_depend_on_momenta():
    peer = fake(oscillator_path, quadratic_only=True)
    assert (
        measured_peer(peer, Interval(RELATIVISTIC, "5"), (0.1, 1.0), 1.0).status
        == "does not fit: it requires T = p.p/2"
    )


def test_steps_per_stage_go_from_coarse_to_fine():
    found = measured_sho(fake(oscillator_path, settings=(), stages=10)).columns
    assert found["tau_per_stage"][0] == pytest.approx(0.5, rel=1e-12)  # one step over [0, 5], ten stages
    assert set(found["tau"]) == {5.0}


def test_lanes_are_timed_where_library_has_them_and_nowhere_else():
    def peer(lanes):
        return dataclasses.replace(
            fake(oscillator_path),
            attempt=lambda *_: Attempt(run=lambda: "one", path=lambda: oscillator_path(1e-6), lanes=lanes),
        )

    for lanes, modes in ((None, {"trajectory"}), (lambda: "eight", {"trajectory", "lanes"})):
        calls = {mode: call for (mode, i), call in measured_sho(peer(lanes)).calls.items() if i == 0}
        assert set(calls) == modes
        assert [calls[mode]() for mode in sorted(modes, reverse=True)] == ["one", "eight"][: len(modes)]


def test_a_run_gone_astray_for_long_is_not_timed(monkeypatch):
    clock = iter(range(0, 100, 10))  # each path seems to take ten seconds
    monkeypatch.setattr("nearharmonic_paper.experiments.work_precision.run.time.perf_counter", lambda: next(clock))
    solver = measured_sho(fake(oscillator_path, settings=(4.0, 1e-2)), 0.5)
    assert (solver.columns["max_energy_error"].tolist(), solver.calls) == ([4.0], {})
    assert solver.status.startswith("stopped")
