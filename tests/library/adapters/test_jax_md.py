"""Methods in JAX MD: states, forces, masses, restarts, derivatives, and what is refused."""

import numpy as np
import pytest

pytest.importorskip("jax_md", reason="JAX MD is not installed", exc_type=ImportError)

import jax
import jax.numpy as jnp
from jax_md import energy, simulate, space

import nearharmonic as nh
from nearharmonic.adapters import jax_md as adapter
from nearharmonic.errors import SettingError
from support.oracles.counted_jax import counted

pytestmark = pytest.mark.usefixtures("double_precision")

SLOW = pytest.mark.slow
KEY = [0, 1]
#: Kick first, drift first, for quadratic T alone, and without symmetry.
METHODS = ("babs7o7h", "abas5o6h", *(pytest.param(name, marks=SLOW) for name in ("leapfrog", "srkn_a14", "ruth_s3o3")))
#: Sums of a few hundred terms of size 1, each rounded to 1.1e-16, in an order that differs.
ROUNDING = 1e-13


def free(position, change, **_):
    return position + change


def oscillators(position):
    return 0.5 * jnp.sum(position**2)


CLUSTER = np.array([[0.0, 0.0, 0.0], [1.15, 0.0, 0.0], [0.6, 1.0, 0.0], [0.55, 0.35, 0.95]])
KICKED = np.array([[0.1, -0.2, 0.05], [-0.05, 0.1, 0.1], [0.0, 0.1, -0.15], [-0.05, 0.0, 0.0]])


def started(init, position, momentum, mass=1.0):
    state = init(jnp.array(KEY, jnp.uint32), jnp.asarray(position), kT=0.0, mass=mass)
    return state.set(momentum=jnp.asarray(momentum))


def run(apply, state, steps):
    return jax.lax.scan(lambda state, _: (apply(state), None), state, None, length=steps)[0]


@SLOW
@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_verlet_gives_states_of_nve_of_jax_md(scale):
    displacement, shift = space.free()
    potential = energy.lennard_jones_pair(displacement)
    masses = scale * (1 + jnp.arange(len(CLUSTER)) % 3)
    step = 1 / 256  # JAX MD rounds its step to single precision, which has this one
    ends = []
    for init, apply in (simulate.nve(potential, shift, step), adapter.nve(potential, shift, step, "verlet")):
        state = init(jnp.array(KEY, jnp.uint32), jnp.asarray(CLUSTER), 0.3, mass=masses)
        ends.append(run(apply, state, 50))
    theirs, ours = ends
    for name in ("position", "momentum", "force", "mass"):
        bound = ROUNDING * (1 + np.abs(getattr(theirs, name)).max())
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=0, atol=bound)
    assert isinstance(ours, simulate.NVEState)
    np.testing.assert_array_equal(ours.velocity, ours.momentum / ours.mass)


@SLOW
@pytest.mark.parametrize("method", ["babs7o7h", "abas5o6h"])
def test_batch_equals_loop_and_costs_the_same(method):
    calls = []
    force = counted(np.negative, calls)
    init, apply = adapter.nve(lambda R, **_: force(R), free, 0.1, method)
    starts = [started(init, scale * CLUSTER, KICKED) for scale in (1.0, 0.5, 2.0)]
    loop = [run(apply, start, 5) for start in starts]
    batch = jax.tree_util.tree_map(lambda *leaves: jnp.stack(leaves), *starts)
    jax.block_until_ready((loop, batch))
    calls.clear()
    together = jax.block_until_ready(jax.jit(jax.vmap(lambda state: run(apply, state, 5)))(batch))
    assert len(calls) == 3 * 5 * nh.integrators[method].stages
    for i, alone in enumerate(loop):
        np.testing.assert_allclose(together.position[i], alone.position, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("method", [pytest.param("leapfrog", marks=SLOW), "babs7o7h", "abas5o6h"])
def test_changed_position_in_a_batch_takes_a_fresh_force(method):
    init, apply = adapter.nve(oscillators, free, 0.1, method)
    state = run(apply, started(init, CLUSTER, KICKED), 3)
    moved = state.set(position=state.position + 0.5, momentum=0.5 * state.momentum)
    expected = apply(started(init, moved.position, moved.momentum))
    both = jax.tree_util.tree_map(lambda *leaves: jnp.stack(leaves), state, moved)
    after = jax.tree_util.tree_map(lambda leaf: leaf[1], jax.vmap(apply)(both))
    np.testing.assert_allclose(after.position, expected.position, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(after.momentum, expected.momentum, rtol=0, atol=ROUNDING)


def test_state_of_jax_md_takes_a_fresh_force():
    init, apply = adapter.nve(oscillators, free, 0.1, "babs7o7h")
    state = started(init, CLUSTER, KICKED)
    stale = simulate.NVEState(state.position, state.momentum, 0 * state.force, state.mass)
    after = run(apply, stale, 2)
    assert type(after) is simulate.NVEState
    np.testing.assert_allclose(after.position, run(apply, state, 2).position, rtol=0, atol=ROUNDING)


@SLOW
@pytest.mark.parametrize("method", ["babs7o7h", "abas5o6h"])
def test_derivatives_pass_through_steps(method):
    """The end depends linearly on the start, and its derivative is the end of a run from 1."""
    init, apply = adapter.nve(oscillators, free, 0.2, method)

    def end(x):
        return run(apply, started(init, jnp.array([[x]]), jnp.array([[0.0]])), 7).position[0, 0]

    one = end(1.0)
    assert float(jax.grad(end)(0.3)) == pytest.approx(float(one), abs=ROUNDING)
    assert float(jax.jvp(end, (0.3,), (1.0,))[1]) == pytest.approx(float(one), abs=ROUNDING)


def test_single_precision_stays_single():
    init, apply = adapter.nve(oscillators, free, 0.1, "babs7o7h")
    key = jnp.array(KEY, jnp.uint32)
    state = run(apply, init(key, jnp.asarray(CLUSTER, jnp.float32), kT=jnp.float32(0.1)), 3)
    assert state.position.dtype == state.momentum.dtype == jnp.float32


def test_step_of_a_call_replaces_step():
    init, apply = adapter.nve(oscillators, free, 0.1, "babs7o7h")
    _, double = adapter.nve(oscillators, free, 0.2, "babs7o7h")
    state = started(init, CLUSTER, KICKED)
    np.testing.assert_array_equal(apply(state, dt=0.2).position, double(state).position)
    with pytest.raises(SettingError, match="dt = -1"):
        apply(state, dt=-1)


@pytest.mark.parametrize("method", ["babs7o7h", "abas5o6h"])
def test_force_is_evaluated_at_the_time_of_positions(method):
    """x'' = t from rest has the solution t^3 / 6, which a method of order three or more solves exactly."""
    init, apply = adapter.nve(lambda R, t=0.0, **_: -t * jnp.sum(R), free, 0.5, method)
    state = started(init, [[0.0]], [[0.0]])
    for i in range(6):
        state = apply(state, t=0.5 * i)
    assert float(state.position[0, 0]) == pytest.approx(4.5, abs=ROUNDING)
    assert float(state.momentum[0, 0]) == pytest.approx(4.5, abs=ROUNDING)


@SLOW
@pytest.mark.filterwarnings("ignore:scatter inputs:FutureWarning")  # of JAX MD
@pytest.mark.parametrize("method", ["babs7o7h", "abas5o6h"])
def test_atoms_that_meet_within_a_step_repel(method):
    """A step of 0.6 carries one particle past the cut-off of another, of which the list knows nothing before."""
    jax.clear_caches()  # JAX cannot compare lists of two potentials
    displacement, shift = space.periodic(10.0)
    neighbours, energy_of = energy.soft_sphere_neighbor_list(displacement, 10.0, dr_threshold=0.02)
    pair = energy.soft_sphere_pair(displacement)
    positions, momenta = jnp.array([[1.0, 5.0], [2.2, 5.1]]), jnp.array([[1.0, 0.0], [0.0, 0.0]])
    ends = []
    for potential, capacity in ((energy_of, 1), (pair, None), (energy_of, 0)):
        init, apply = adapter.nve(potential, shift, 0.6, method)
        listed = {} if capacity is None else {"neighbor": neighbours.allocate(positions, extra_capacity=capacity)}
        state = init(jnp.array(KEY, jnp.uint32), positions, kT=0.0, **listed).set(momentum=momenta)
        if capacity == 0:
            with pytest.warns(UserWarning, match="neighbor overflowed within a step"):
                jax.block_until_ready((apply(state, **listed), jax.effects_barrier()))
            break
        ends.append(apply(state, **listed))
    np.testing.assert_allclose(ends[0].momentum, ends[1].momentum, rtol=0, atol=ROUNDING)
    assert abs(ends[1].momentum[1, 0]) > 1e-3


@SLOW
def test_arguments_of_energy_reach_it():
    init, apply = adapter.nve(lambda R, stiffness: 0.5 * stiffness * jnp.sum(R**2), free, 0.1, "babs7o7h")
    hard = init(jnp.array(KEY, jnp.uint32), jnp.asarray(CLUSTER), kT=0.0, stiffness=4.0)
    np.testing.assert_allclose(hard.force, -4 * CLUSTER, rtol=1e-15)
    end = apply(hard, stiffness=4.0)
    # cos(2 t) to the error of the method, of order 4, at 1/70 of a period
    np.testing.assert_allclose(end.position, np.cos(0.2) * CLUSTER, rtol=1e-8)


@pytest.mark.parametrize(
    "mass",
    [0.0, -1.0, float("nan"), float("inf"), "heavy", np.array([1.0, 0.0, 1.0, 1.0]), np.ones(3), np.ones((4, 3))],
)
def test_bad_mass_is_refused(mass):
    init, _ = adapter.nve(oscillators, free, 0.1, "babs7o7h")
    with pytest.raises(SettingError, match="mass = "):
        init(jnp.array(KEY, jnp.uint32), jnp.asarray(CLUSTER), kT=0.1, mass=mass)
