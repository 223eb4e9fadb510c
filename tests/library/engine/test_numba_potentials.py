"""Systems whose V is a function of numba: their runs, what they refuse, and the floor of their energy errors."""

import re
from dataclasses import replace

import numba
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core.expression import Graph
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import NearharmonicError, SettingError, SystemDefinitionError
from support.methods.numba_potentials import polynomial, spring, spring_force, springs, walled

V, grad_V = walled([0.5, 0.1, 0.25])
WALLED = nh.System(name="walled", V=V, grad_V=grad_V, q0=1, p0=0, t_end=20)
SMOOTH = nh.System(name="smooth", V=polynomial, q0=1, p0=0, t_end=20)
SPRING = springs()


@pytest.mark.slow
def test_a_force_of_the_same_operations_gives_the_same_bits():
    traced = nh.System(name="traced", V=lambda q: q[0] * q[0] / 2, q0=1, p0=0, t_end=20)
    for method in ("ruth", "babps9o7h"):
        ours, theirs = (nh.integrate(one, method, 0.1, samples=50) for one in (SPRING, traced))
        for name in ("q", "p", "q_low", "p_low"):
            np.testing.assert_array_equal(ours[name], theirs[name])
        # V is rounded twice in double, and to 1e-32 as a formula.
        np.testing.assert_allclose(ours.energy_error, theirs.energy_error, atol=2 * 2.0**-53, rtol=0)


def test_runs_agree_with_those_of_the_formula_to_rounding():
    ours, theirs = (nh.integrate(one, "aba864", 0.1, samples=50) for one in (WALLED, SMOOTH))
    # 1400 forces, each rounded some times and applied over 0.02; the well is stable, so that errors do not grow.
    np.testing.assert_allclose(ours.q, theirs.q, atol=1400 * 0.02 * 8 * 2.0**-53, rtol=0)


def test_exceptions_end_the_run_as_diverged():
    run = nh.integrate(WALLED, "ruth", 0.01, p0=[4], energy="samples")
    assert (run.status, run.max_energy_error) == ("diverged", np.inf)


def test_exceptions_at_the_start_are_told():
    with pytest.raises(SystemDefinitionError, match=r"^walled: V raises ValueError at the start: beyond the walls$"):
        nh.integrate(replace(WALLED, q0=3), "ruth", 0.1)


def test_parameters_are_those_of_each_run():
    stiffness = np.array([0.25, 1, 4, 9])
    found = nh.ensemble(SPRING, "s15odr8", 0.02, parameters={"k": stiffness}, samples=20, threads=2)
    exact = np.cos(np.sqrt(stiffness)[:, None] * found.t.values)
    np.testing.assert_allclose(found.q[..., 0], exact, atol=1e-11)  # of order eight at 0.06 radians a step
    assert found.energy_floor < 1e-14


def test_threads_find_the_bits_of_single_runs():
    starts = np.random.default_rng(1).uniform(-1, 1, (300, 1))
    few, many = (nh.ensemble(SPRING, "ruth", 0.1, q0=starts, p0=[0.5], threads=n) for n in (1, 2))
    assert few.identical(many)
    alone = nh.integrate(SPRING, "ruth", 0.1, q0=starts[7], p0=[0.5])
    assert float(alone.max_energy_error) == float(few.max_energy_error[7])


@numba.njit
def ring(q):
    energy = 0.0
    for i in range(q.size):
        energy += (q[i] ** 2 + (q[i] - q[i - 1]) ** 2) / 2
    return energy


@numba.njit
def ring_force(q):
    force = np.empty(q.size)
    for i in range(q.size):
        force[i] = 3 * q[i] - q[i - 1] - q[(i + 1) % q.size]
    return force


def wave(sites):
    """The longest wave but one of a ring, and its frequency."""
    k = 2 * np.pi / sites
    return np.sin(k * np.arange(sites)), np.sqrt(1 + 4 * np.sin(k / 2) ** 2)


@pytest.mark.slow
def test_many_coordinates_come_as_an_array():
    q0, frequency = wave(20)
    system = nh.System(name="ring", V=ring, grad_V=ring_force, q0=q0, p0=np.zeros(20), t_end=20)
    end = nh.integrate(system, "s15odr8", 0.05, samples=2)
    np.testing.assert_allclose(end.q[-1], q0 * np.cos(frequency * 20), atol=1e-11)


def test_a_gradient_of_another_length_is_refused():
    longer = numba.njit(lambda q: np.zeros(2))
    with pytest.raises(SystemDefinitionError, match=r"^walled: grad_V returns 2 components, expected .*: 1$"):
        nh.integrate(replace(WALLED, grad_V=longer), "ruth", 0.1)


@pytest.mark.slow
def test_a_slightly_wrong_gradient_is_refused():
    wrong = numba.njit(lambda q, k: (k * q[0] * (1 + 1e-9),))
    with pytest.raises(SystemDefinitionError, match=r"^spring: grad_V\[0\] contradicts V: .* by differences is"):
        nh.integrate(springs(grad_V=wrong), "ruth", 0.1)


STIFFNESS = 1.0


@numba.njit
def stiff(q):
    return STIFFNESS * q[0] * q[0] / 2


@numba.njit
def stiff_force(q):
    return (STIFFNESS * q[0],)


@numba.njit
def single(q, k):
    return float(np.float32(k) * np.float32(q[0]) * np.float32(q[0]) / np.float32(2))


@pytest.mark.slow
@pytest.mark.parametrize(("system", "size"), [(SPRING, 1e-16), (springs(V=single), 1e-8)], ids=["double", "single"])
def test_the_floor_is_the_least_error_that_runs_show(system, size):
    run = nh.integrate(system, "s15odr8", 0.05, q0=["0.7"])
    least = float(run.max_energy_error)  # of order eight at 0.003 radians a stage, without rounding below 1e-20
    assert size < run.energy_floor < 100 * size
    assert 1 / 4 < run.energy_floor / least < 4


def test_plots_draw_the_floor_where_errors_come_near_it():
    for tau, near in ((0.05, True), (1.0, False)):
        curve = nh.sweep(SPRING, "s15odr8", [tau, 2 * tau])
        texts = [text.get_text() for axes in nh.plot(curve).axes for text in axes.texts]
        assert (f"rounding of V, {curve.energy_floor:.0e}" in texts) == near


def test_a_recommendation_marks_errors_near_the_floor():
    from nearharmonic.commands.choice import ranking
    from nearharmonic.recommendation.recommend import recommendation
    from nearharmonic.recommendation.search import Search

    for error, near in (("1e-15", True), ("1e-6", False)):
        found = ranking(recommendation(Search(SPRING, error, methods=["s15odr8"], budget=20_000)))
        assert str(found.rows[0][-1]).endswith(" *") == near
        assert any("the rounding of V" in note for note in found.notes) == near


@pytest.mark.slow
def test_positions_are_compared_with_fine_runs_in_double():
    fast = springs(parameters={"k": 400})  # 64 periods, for which the first reference is too coarse
    found = nh.recommend(fast, 1e-6, measure="position", methods=["ruth"])
    run = nh.integrate(fast, "ruth", float(found.tau[0]), summation=str(found.summation.values[0]))
    off = abs(float(run.q[-1, 0]) - np.cos(400))
    assert float(found.position_error[0]) == pytest.approx(off, abs=1e-11)  # error of the reference in double


def test_copies_keep_the_functions_that_they_do_not_change():
    copy = replace(SPRING, name="copy", q0=2)
    assert copy.V == SPRING.V
    assert copy.V((3.0,), 2.0) == 9
    np.testing.assert_array_equal(copy.grad_V((np.arange(3.0),), 2.0)[0], [0, 2, 4])


def test_a_value_that_numba_keeps_must_not_change(monkeypatch):
    made = nh.System(name="kept", V=stiff, grad_V=stiff_force, q0=["1"], p0=["0"], t_end="1")
    monkeypatch.setitem(globals(), "STIFFNESS", 2.0)  # before the first call
    run = nh.integrate(made, "aba864", 0.02, samples=1)
    assert run.q.values[-1, 0] == pytest.approx(np.cos(2**0.5), abs=1e-7)
    monkeypatch.setitem(globals(), "STIFFNESS", 4.0)
    with pytest.raises(SystemDefinitionError, match="kept: V and grad_V read other values than at their first call"):
        nh.integrate(made, "aba864", 0.02)


def test_hessians_are_differences_of_gradients():
    x = np.array([-1.2, 0.2, 0.4, 1.0])
    (ours,), (exact,) = (one.hessian_V_times((x,), (np.ones(4),)) for one in (WALLED, SMOOTH))
    np.testing.assert_allclose(ours, exact, rtol=1e-9)  # truncation is (2^-17)^2, rounding 2^-53 over 2^-17


DEFINITIONS = {
    "no gradient": ({"grad_V": None}, r"V is a .* not derived: give grad_V, which returns one number per coordinate"),
    "plain gradient": ({"grad_V": lambda q, k: q}, "V is a function of numba and grad_V is not"),
    "plain potential": ({"V": lambda q, k: q[0]}, "grad_V is a function of numba and V is not"),
    "kinetic energy": ({"T": spring}, "T is a function of numba, which V and grad_V alone may be"),
    "time": ({"time_dependent": True}, "time_dependent = True is not allowed for a V of numba"),
    "harmonic": ({"harmonic": True, "parameters": {"k": 1}}, "harmonic = True is not allowed for a V of numba"),
    "too many": ({"q0": [1] * 257, "p0": [0] * 257}, "q0 has 257 components, and a system .* at most 256"),
}  # fmt: skip


@pytest.mark.parametrize("case", DEFINITIONS)
def test_definitions_that_need_an_expression_are_refused(case):
    changes, message = DEFINITIONS[case]
    with pytest.raises(SystemDefinitionError, match=rf"^spring: {message}"):
        springs(**changes)


def test_missing_gradient_is_shown_by_example_that_is_right():
    with pytest.raises(SystemDefinitionError) as caught:
        springs(grad_V=None)
    (source, formula) = re.findall(r"(def grad_V.*) for V = (.*)$", str(caught.value))[0]
    names = {}
    exec(source, names)
    assert formula == "k q[0]^2 / 2"
    assert names["grad_V"]((3.0,), 2.0) == spring_force.py_func((3.0,), 2.0)


SETTINGS = {
    "precision": {"precision": "extended"},
    "split": {"split": "exact_oscillator"},
    "modified": {"integrator": "chin_4a"},
}


@pytest.mark.parametrize("case", SETTINGS)
def test_settings_that_need_an_expression_are_refused_in_a_sentence(case):
    given = {"integrator": "ruth"} | SETTINGS[case]
    with pytest.raises(SettingError, match=r" function of numba\b"):
        nh.integrate(springs(frequencies=("1",)), given.pop("integrator"), 0.1, **given)


def test_lanes_are_refused_in_a_sentence():
    with pytest.raises(
        SettingError, match=r"^width = 8 is not allowed: V of spring is a function of numba, which takes one"
    ):
        kernel_of(SPRING, Numerics(width=8))


def test_what_is_written_from_expression_is_refused_in_sentence():
    with pytest.raises(NearharmonicError, match=r"^spring: grad_V is a function of numba, which is not traced"):
        SPRING.formulas().grad_V(Graph().variables(1), *Graph().variables(len(SPRING.parameters)))
