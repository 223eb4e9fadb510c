"""Methods in diffrax: states, forces, output between steps, derivatives, restarts, and what is refused."""

from functools import cache

import numpy as np
import pytest

pytest.importorskip("diffrax", reason="diffrax is not installed", exc_type=ImportError)

import diffrax
import jax
import jax.numpy as jnp

import nearharmonic as nh
from nearharmonic.adapters.diffrax import Splitting
from support.oracles.counted_jax import counted

pytestmark = pytest.mark.usefixtures("double_precision")

SLOW = pytest.mark.slow
#: Kick first and drift first.
ROLES = ("babs7o7h", "abas5o6h")
#: Some hundreds of sums of terms of size 1, each rounded to 1.1e-16.
ROUNDING = 1e-13


def pair(force, velocity=lambda t, p, args: p):
    return diffrax.ODETerm(velocity), diffrax.ODETerm(force)


def spring(t, q, args):
    return -q


OSCILLATOR = (jnp.array([1.0]), jnp.array([0.0]))


def counted_spring(calls):
    force = counted(np.negative, calls)
    return lambda t, q, args: force(q)


def solved(force, method, t1, dt0, y0=OSCILLATOR, *, velocity=lambda t, p, args: p, **settings):
    return diffrax.diffeqsolve(pair(force, velocity), Splitting(method), 0.0, t1, dt0, y0, **settings)


@pytest.mark.parametrize(
    ("method", "saved", "more"),
    [
        ("babs7o7h", diffrax.SaveAt(t1=True), 1),
        pytest.param("babs7o7h", diffrax.SaveAt(ts=np.linspace(0, 5, 4)), 1, marks=SLOW),
        ("abas5o6h", diffrax.SaveAt(t1=True), 0),
        pytest.param("abas5o6h", diffrax.SaveAt(steps=True), 0, marks=SLOW),
        ("abas5o6h", diffrax.SaveAt(ts=np.linspace(0, 5, 4)), 2 * 10),
        pytest.param("ruth_s3o3", diffrax.SaveAt(t1=True), 1, marks=SLOW),
    ],
)
def test_step_evaluates_one_force_a_stage(method, saved, more):
    calls = []
    jax.block_until_ready(solved(counted_spring(calls), method, 5.0, 0.5, saveat=saved).ys)
    assert len(calls) == 10 * nh.integrators[method].stages + more


@SLOW
@pytest.mark.parametrize("method", ROLES)
def test_batch_equals_loop_and_costs_the_same(method):
    calls = []

    def end(q):
        return solved(counted_spring(calls), method, 5.0, 0.5, (q, 0 * q)).ys

    starts = jnp.array([[1.0], [0.5], [-2.0]])
    loop = [end(start) for start in starts]
    calls_of_loop = len(calls)
    together = jax.block_until_ready(jax.vmap(end)(starts))
    assert len(calls) == 2 * calls_of_loop
    for i, (q, p) in enumerate(loop):
        np.testing.assert_allclose(together[0][i], q, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(together[1][i], p, rtol=0, atol=ROUNDING)


@SLOW
@pytest.mark.parametrize("method", ROLES)
@pytest.mark.parametrize("backwards", [False, True])
def test_output_between_steps_has_order_four(method, backwards):
    times, errors = np.linspace(0.05, 3.95, 40), []
    for dt0 in (0.5, 0.25):
        sign = -1 if backwards else 1
        run = solved(spring, method, sign * 4.0, sign * dt0, saveat=diffrax.SaveAt(ts=sign * times))
        q, p = (ys[:, 0] for ys in run.ys)
        errors.append([np.abs(q - np.cos(times)).max(), np.abs(p + sign * np.sin(times)).max()])
    assert np.max(errors[0]) < 0.5**4 / 384 * 1.1  # h^4/384 max |q''''|, and the method's own error below a tenth
    np.testing.assert_allclose(np.log2(np.divide(*errors)), 4, atol=0.2)  # 40 times miss the middle of some steps


@SLOW
def test_trees_of_arrays_are_integrated():
    start = {"a": jnp.array([1.0]), "b": jnp.array([[2.0, 3.0]])}
    still = jax.tree_util.tree_map(jnp.zeros_like, start)
    q, _ = solved(lambda t, q, args: jax.tree_util.tree_map(jnp.negative, q), "babs7o7h", 5.0, 0.5, (start, still)).ys
    expected, _ = solved(spring, "babs7o7h", 5.0, 0.5).ys
    np.testing.assert_allclose(q["b"][-1], expected[-1] * np.array([[2.0, 3.0]]), rtol=1e-14)


@SLOW
@pytest.mark.parametrize("method", ROLES)
def test_terms_that_depend_on_time_keep_the_order(method):
    """H = exp(-t/5) p^2/2 + exp(t/5) q^2/2 - sin(t) q without its force: q'' + q'/5 + q = 0."""
    w = np.sqrt(1 - 0.01)
    exact = np.exp(-0.1 * 4) * (np.cos(w * 4) + 0.1 / w * np.sin(w * 4))
    errors = []
    for dt0 in (1.0, 0.5):
        run = solved(
            lambda t, q, args: -jnp.exp(t / 5) * q, method, 4.0, dt0, velocity=lambda t, p, args: jnp.exp(-t / 5) * p
        )
        errors.append(abs(run.ys[0][-1, 0] - exact))
    assert errors[0] < 1e-3
    assert np.log2(errors[0] / errors[1]) > 3.5  # order 4; one clock for both flows gives 2


@cache
def slopes(method):
    """End of the oscillator from 1, and the derivative of q by the stiffness in central differences."""

    def end(stiffness):
        return solved(lambda t, q, k: -k * q, method, 3.0, 0.5, args=stiffness).ys[0][-1, 0]

    h = 1e-5  # errors h^2 = 1e-10 and 1e-16/h = 1e-11
    return float(end(1.0)), float((end(1 + h) - end(1 - h)) / (2 * h))


#: Older versions have no forward mode.
ADJOINTS = [x for x in ("RecursiveCheckpointAdjoint", "DirectAdjoint", "ForwardMode") if hasattr(diffrax, x)]


@SLOW
@pytest.mark.parametrize("method", ROLES)
@pytest.mark.parametrize("adjoint", ADJOINTS)
def test_derivatives_pass_through_the_solver(method, adjoint):
    """The end depends linearly on the start: its derivative is the end of the run from 1."""

    def end(start, stiffness):
        force = lambda t, q, k: -k * q  # noqa: E731
        settings = {"args": stiffness, "adjoint": getattr(diffrax, adjoint)(), "max_steps": 8}
        return solved(force, method, 3.0, 0.5, (start * jnp.ones(1), jnp.zeros(1)), **settings).ys[0][-1, 0]

    derive = jax.jacfwd if adjoint == "ForwardMode" else jax.grad
    by_start, by_stiffness = derive(end, argnums=(0, 1))(1.0, 1.0)
    exact, differences = slopes(method)
    assert float(by_start) == pytest.approx(exact, abs=ROUNDING)
    assert float(by_stiffness) == pytest.approx(differences, abs=1e-8)


@SLOW
@pytest.mark.parametrize("method", ROLES)
def test_run_goes_on_from_the_state_of_another(method):
    calls = []
    saved = diffrax.SaveAt(t1=True, solver_state=True)
    half = solved(counted_spring(calls), method, 2.0, 0.5, saveat=saved)
    q, p = half.ys[0][-1], half.ys[1][-1]
    jax.block_until_ready(q)
    calls.clear()
    terms, solver = pair(counted_spring(calls)), Splitting(method)
    on = diffrax.diffeqsolve(terms, solver, 2.0, 4.0, 0.5, (q, p), solver_state=half.solver_state)
    np.testing.assert_allclose(on.ys[0][-1], solved(spring, method, 4.0, 0.5).ys[0][-1], rtol=0, atol=ROUNDING)
    assert len(calls) == 4 * nh.integrators[method].stages


@pytest.mark.parametrize("method", ROLES)
@pytest.mark.parametrize("told", [pytest.param({}, marks=SLOW), {"made_jump": True}])
def test_changed_state_takes_a_fresh_force(method, told):
    half = solved(spring, method, 2.0, 0.5, saveat=diffrax.SaveAt(t1=True, solver_state=True))
    moved = (half.ys[0][-1] + 0.5, 0.5 * half.ys[1][-1])
    state = {**told, "solver_state": half.solver_state} if told else {}
    on = diffrax.diffeqsolve(pair(spring), Splitting(method), 2.0, 4.0, 0.5, moved, **state)
    fresh = solved(spring, method, 2.0, 0.5, moved)
    np.testing.assert_allclose(on.ys[0][-1], fresh.ys[0][-1], rtol=0, atol=ROUNDING)
