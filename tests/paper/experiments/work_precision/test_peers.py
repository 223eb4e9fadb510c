"""Other libraries on equal systems: their equations and timed calls, and what is said of those that are missing."""

import ctypes
import dataclasses
import sys
from fractions import Fraction
from importlib.util import find_spec
from math import inf, sqrt

import numpy as np
import pytest
from mpmath import mpf

from nearharmonic.engine.reference import reference
from nearharmonic.engine.settings import tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.recommendation.measure import Interval, quiet
from nearharmonic.systems import Parameter, System, systems
from nearharmonic.systems.gradients import velocity
from nearharmonic_paper.experiments.work_precision import WorkPrecisionSettings, peers
from nearharmonic_paper.experiments.work_precision.run import energy_errors, measured_peer
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


@pytest.mark.parametrize("library", [name for name in peers.LIBRARIES if name != "numpy"])
def test_a_library_that_is_missing_is_named_not_skipped(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)  # what Python itself does to forbid an import
    monkeypatch.setenv("PATH", "")  # where compilers are looked for
    assert peers.missing(library) == "not installed"
    for peer in peers.PEERS.values():
        if peer.module == library:
            solver = measured_peer(peer, Interval(systems["kepler"], "5"), (0.1, 1.0), 1.0)
            assert (solver.method, solver.status, solver.settings) == (peer.name, "not installed", 0)
    assert peers.is_installed("numpy")
    assert not peers.is_installed("gcc")


def test_a_library_that_is_broken_says_how(monkeypatch, tmp_path):
    (tmp_path / "heyoka.py").write_text("raise ImportError('libsomething.so: cannot open')")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "heyoka", raising=False)
    assert peers.missing("heyoka") == "cannot be imported: libsomething.so: cannot open"


def test_all_solvers_are_timed_unless_the_config_names_libraries():
    assert WorkPrecisionSettings().solvers() == list(peers.PEERS)
    expected = [n for n, p in peers.PEERS.items() if p.module == "heyoka"]
    assert WorkPrecisionSettings(peers=("heyoka",)).solvers() == expected


def test_methods_in_numpy_end_where_the_matrix_power_ends():
    for name in ("aba864", "babps9o7h"):  # a drift first and a kick first
        states, evaluations = peers.numpy_splitting(integrators[name])(systems["sho"], 5.0, 0.25).path()
        q, p = oscillator_state(integrators[name], mpf(5) / 20, 20)
        # 20 steps of up to 20 roundings of 1e-16 each.
        assert states[-1] == pytest.approx([float(q), float(p)], abs=400 * 1.2e-16)
        assert len(states) == 21
        assert evaluations == integrators[name].stages * 20 + 1


def test_what_is_timed_is_what_is_measured():
    attempt = peers.numpy_splitting(integrators["aba864"])(systems["henon_heiles"], 5.0, 0.25)
    assert np.concatenate(attempt.run()).tolist() == attempt.path()[0][-1].tolist()


def test_energy_errors_are_taken_over_every_state_but_the_first():
    states = np.array([[1.0, 0.0], [1.0, 1.0], [2.0, 0.0]])  # H = 1/2, 1, 2
    assert energy_errors(systems["sho"], states) == (3.0, 2.0)
    assert energy_errors(systems["sho"], np.array([[1.0, 0.0], [np.nan, 0.0]])) == (inf, inf)


def test_the_written_velocity_is_hamiltons():
    for system in systems.values():
        if system.regularisation is not None:
            continue  # its equations have other coordinates
        d = system.dimension
        q, p = (tuple(0.3 + 0.1 * i + shift for i in range(d)) for shift in (0.0, 0.5))
        constants = [float(Fraction(parameter.value)) for parameter in system.parameters.values()]
        expected = [*system.grad_T(p), *(-force for force in system.grad_V(q, *constants))]
        # The same operations in the same order: equal, but for how the constants fold.
        assert velocity(system)(*q, *p) == pytest.approx(expected, rel=4e-16)


def fake(path, settings=(1e-2, 1e-4, 1e-6), **more):
    """A peer of numpy, which is always there, whose path is ``path(setting)``."""
    return peers.Peer(
        name="fake", label="Fake", module="numpy", settings=settings,
        attempt=lambda system, t_end, setting: peers.Attempt(run=lambda: None, path=lambda: path(setting)), **more,
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
            attempt=lambda *_: peers.Attempt(run=lambda: "one", path=lambda: oscillator_path(1e-6), lanes=lanes),
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "name"),
    [
        # On the oscillator diffrax, which compiles for seconds, has a test below.
        pytest.param(system, name, marks=[pytest.mark.slow] * ((system, peer.module) == ("sho", "diffrax")))
        for system in ("sho", "kepler")
        for name, peer in peers.PEERS.items()
        if peers.is_installed(peer.module)
        and (systems[system].gravity or not peer.gravity_only)
        and not peer.regularised
    ],
)
def test_installed_peers_converge_to_the_exact_position(system, name):
    t_end = {"sho": "5", "kepler": "2000"}[system]
    ranges = {"sho": (0.02, 0.3), "kepler": (2.0, 60.0)}[system]
    problem = Interval(systems[system], t_end, reference(systems[system], t_end))
    errors = measured_peer(peers.PEERS[name], problem, tau_grid(*ranges, 4), 5.0).columns["position_error"]
    # From the coarsest to the finest setting each gains three decades at least: 1e-3 to 1e-9 of a tolerance, and 30 in
    # step size to the fourth power, leave more.
    assert min(errors) < 1e-3 * min(1.0, errors[0]) or min(errors) < 1e-12


@pytest.mark.skipif(find_spec("heyoka") is None, reason="heyoka is optional")
def test_a_modulus_reaches_a_library_that_has_none():
    """V = |q|^3 / 3 from q = -1: heyoka's energy error at a tolerance of 1e-15 is rounding."""
    cubic = System(
        name="cubic", label="cubic", V=lambda q: abs(q[0]) ** 3 / 3, grad_V=lambda q: (q[0] * abs(q[0]),),
        q0=("-1",), p0=("0",), t_end="1", units=dict.fromkeys(("q", "p", "t", "energy"), "1"), source="made up",
    )  # fmt: skip
    with quiet():  # its imports warn
        states, _ = peers.PEERS["heyoka"].attempt(cubic, 1.0, 1e-15).path()
    assert states[-1][0] > -0.7
    assert max(energy_errors(cubic, states)) < 4e-15


needs_rebound = pytest.mark.skipif(not find_spec("rebound"), reason="rebound is not installed")


@needs_rebound
def test_rebound_uses_own_gravity_for_any_system_name():
    """A star and a planet with G the parameter GM; a force compiled by numba acts on a single particle."""
    heavy = Parameter(value="2.5", unit="1", meaning="gravitational constant times mass")
    planet = dataclasses.replace(systems["kepler"], name="planet", parameters={"GM": heavy})
    made = peers.rebound_simulation(planet, ctypes.c_double())
    assert (made.N, made.G, made.gravity) == (2, 2.5, "basic")
    made = peers.rebound_simulation(systems["sho"], ctypes.c_double())
    assert (made.N, made.gravity) == (1, "none")


@needs_rebound
def test_the_compiled_force_is_that_of_henon_and_heiles():
    import rebound

    x, y, count = 0.3, -0.2, ctypes.c_double(4.0)
    simulation = rebound.Simulation()
    simulation.add(m=1.0, x=x, y=y, z=0.7, vx=0.5, vy=0.6)
    simulation.particles[0].az = 0.9
    simulation.extras = ctypes.addressof(count)
    force = peers.compiled_force(systems["henon_heiles"]).ctypes
    force(ctypes.cast(ctypes.byref(simulation), *force.argtypes))
    body = simulation.particles[0]
    # V = (x^2 + y^2)/2 + x^2 y - y^3/3 by hand; a rounding or two of numbers below 1.
    assert [body.ax, body.ay] == pytest.approx([-x - 2 * x * y, -y - x * x + y * y], abs=2e-16)
    assert (body.x, body.y, body.z, body.vx, body.vy, body.az, count.value) == (x, y, 0.7, 0.5, 0.6, 0.9, 5.0)


@needs_rebound
@pytest.mark.parametrize("name", ["henon_heiles", "kepler"])
def test_rebounds_leapfrog_of_order_8_takes_17_forces_a_step(name):
    # A composition of 17 leapfrogs, each with one force.
    states, evaluations = peers.PEERS["rebound_leapfrog8"].attempt(systems[name], 5.0, 0.5).path()
    assert (len(states), evaluations) == (11, 10 * peers.PEERS["rebound_leapfrog8"].stages) == (11, 170)


@needs_rebound
@pytest.mark.parametrize("name", ["rebound_ias15", "rebound_leapfrog8"])
@pytest.mark.parametrize("system", ["henon_heiles", "kepler"])
def test_rebound_starts_anew_each_time_it_is_timed(name, system):
    attempt = peers.PEERS[name].attempt(systems[system], 5.0, {"rebound_ias15": 1e-6, "rebound_leapfrog8": 0.5}[name])
    ends = []
    for _ in range(2):
        body = attempt.run()
        ends.append([body.x, body.y, body.vx, body.vy])
    # One simulation run twice, and another one run step by step, in the same arithmetic.
    assert ends == [attempt.path()[0][-1].tolist()] * 2


@pytest.mark.skipif(not find_spec("heyoka"), reason="heyoka is not installed")
@pytest.mark.parametrize("name", ["heyoka", "heyoka_fast_math"])
def test_each_lane_of_heyoka_ends_where_the_oscillator_ends(name):
    with quiet():  # its imports warn
        attempt = peers.PEERS[name].attempt(systems["sho"], 5.0, 1e-15)
    for _ in range(2):  # it starts anew each time
        states = attempt.lanes()
        assert states.shape == (2, attempt.members) == (2, 8)
        assert states == pytest.approx(np.array([[np.cos(5.0)], [-np.sin(5.0)]]).repeat(8, axis=1), abs=1e-14)


def test_a_solver_written_for_gravity_is_refused_elsewhere():
    solver = measured_peer(peers.PEERS["heyoka_power"], Interval(systems["sho"], "5"), (0.1, 1.0), 1.0)
    if solver.status != "not installed":
        assert (solver.settings, solver.status) == (0, "does not fit: it requires V = -GM/|q|")


@pytest.mark.skipif(not find_spec("heyoka"), reason="heyoka is not installed")
def test_force_as_power_is_force_of_formula():
    """Steps are chosen alike; rounding grows with the square of the time, to less than 1e-12 in one orbit."""
    with quiet():  # its imports warn
        one, other = (
            peers.PEERS[name].attempt(systems["kepler"], 2000.0, 1e-15) for name in ("heyoka", "heyoka_power")
        )
    assert one.run().tolist() == pytest.approx(other.run().tolist(), rel=1e-12)


needs_gcc = pytest.mark.skipif(not peers.is_installed("gcc"), reason="gcc is not installed")


@needs_gcc
@pytest.mark.parametrize("system", ["sho", "henon_heiles"])
def test_the_loop_in_c_makes_the_steps_of_the_method(system):
    """Plain numpy makes the same steps: numbers below 1, ten steps of nine stages, a rounding or two each."""
    ours = peers.numpy_splitting(integrators["babps9o7h"])(systems[system], 5.0, 0.5)
    theirs = peers.PEERS["c_babps9o7h"].attempt(systems[system], 5.0, 0.5)
    expected, evaluations = ours.path()
    states, counted = theirs.path()
    assert counted == evaluations == 91
    assert states == pytest.approx(expected, abs=90 * 4 * 1.2e-16)
    for _ in range(2):  # it starts anew each time it is timed
        assert theirs.run() == pytest.approx(expected[-1], abs=90 * 4 * 1.2e-16)


@needs_gcc
def test_powers_and_moduli_of_formulas_reach_the_loop_in_c():
    cubic = System(
        name="cubic", label="cubic", V=lambda q: abs(q[0]) ** 3 / 3 + 1 / (2 + q[0]) ** 2, q0=("-1",), p0=("0",),
        t_end="1", units=dict.fromkeys(("q", "p", "t", "energy"), "1"), source="made up",
    )  # fmt: skip
    states, _ = peers.PEERS["c_babps9o7h"].attempt(cubic, 1.0, 0.01).path()
    assert abs(states[-1][0] + 1) > 0.1
    assert max(energy_errors(cubic, states)) < 1e-9  # of order 4, where V'' jumps at 0 that is not reached


@pytest.mark.skipif(not find_spec("diffrax"), reason="diffrax is not installed")
def test_diffrax_uses_double_precision_and_keeps_jax_setting():
    import jax

    before = jax.config.jax_enable_x64
    with quiet():
        attempt = peers.PEERS["diffrax_dopri8"].attempt(systems["sho"], 5.0, 1e-13)
    state = attempt.run()
    assert state.dtype == np.float64
    assert state == pytest.approx([np.cos(5.0), -np.sin(5.0)], abs=1e-10)
    assert jax.config.jax_enable_x64 == before
    assert attempt.path()[0][-1] == pytest.approx(state, abs=1e-15)


def test_other_libraries_are_not_run_on_regularised_equations():
    solver = measured_peer(peers.PEERS["numpy_aba864"], Interval(systems["kepler_regularised"], "5"), (0.1, 1.0), 1.0)
    assert solver.settings == 0
    assert solver.status.startswith("not written for regularised equations")


@pytest.mark.skipif(not find_spec("heyoka"), reason="heyoka is not installed")
@pytest.mark.parametrize("A", ["0", "0.02"])
def test_heyoka_on_regularised_equations_reaches_original_end(A):
    """One orbit, at the finest tolerance: rounding of some hundred steps, 1e-12 of the distance."""
    regularised = systems["kepler_regularised"]
    parameters = regularised.parameters | {"A": dataclasses.replace(regularised.parameters["A"], value=A)}
    regularised = dataclasses.replace(regularised, parameters=parameters)
    original = dataclasses.replace(regularised, regularisation=None)
    with quiet():  # its imports warn
        one = peers.PEERS["heyoka"].attempt(original, 2000.0, 1e-15)
        other = peers.PEERS["heyoka_regularised"].attempt(regularised, 2000.0, 1e-15)
    expected, (states, _) = one.path()[0][-1], other.path()
    assert states[-1] == pytest.approx(expected, abs=1e-12 * 69.82)
    assert max(energy_errors(regularised, states)) < 1e-14
    assert other.run()[-1] == pytest.approx(1, abs=1e-13)  # t/t_end


@pytest.mark.skipif(not find_spec("heyoka"), reason="heyoka is not installed")
def test_a_solver_of_regularised_equations_is_refused_elsewhere():
    solver = measured_peer(peers.PEERS["heyoka_regularised"], Interval(systems["kepler"], "5"), (0.1, 1.0), 1.0)
    assert (solver.settings, solver.status) == (0, "does not fit: it requires a system with a regularisation")
