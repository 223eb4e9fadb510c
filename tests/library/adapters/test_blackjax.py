"""Methods in BlackJAX: its own integrators as oracles, gradients counted, and what is refused."""

import numpy as np
import pytest

pytest.importorskip("blackjax", reason="BlackJAX is not installed", exc_type=ImportError)

import blackjax
import jax
import jax.numpy as jnp
from blackjax.mcmc import integrators as theirs
from blackjax.mcmc.metrics import gaussian_euclidean

import nearharmonic as nh
from nearharmonic.adapters import blackjax as adapter
from nearharmonic.errors import SettingError
from support.oracles.counted_jax import counted_density

pytestmark = pytest.mark.usefixtures("double_precision")

#: Some hundreds of sums of terms of size 1, each rounded to 1.1e-16.
ROUNDING = 1e-13


def gaussian(x):
    return -0.5 * jnp.sum(x**2)


def quartic(x):
    return -0.25 * jnp.sum(x**4)


def henon_heiles(x):
    return -((x[0] ** 2 + x[1] ** 2) / 2 + x[0] ** 2 * x[1] - x[1] ** 3 / 3)


def kinetic(dimension):
    return gaussian_euclidean(jnp.ones(dimension)).kinetic_energy


def moved(factory, density, step_size, steps, q, p):
    """State after some steps of an integrator."""
    step = factory(density, kinetic(len(q)))
    state = theirs.new_integrator_state(density, jnp.asarray(q), jnp.asarray(p))
    return jax.lax.scan(lambda state, _: (step(state, step_size), None), state, None, length=steps)[0]


B = "0.1931833275037836"
#: McLachlan's method of two stages is not registered; BlackJAX has BCSS 3 with the kick first as its "yoshida".
MINIMAL = nh.Tableau(
    name="minimal", order=2, first="kick", kick=(B, "0.6136333449924328", B), drift=("0.5", "0.5"), digits=16,
    source="McLachlan (1995), SIAM J. Sci. Comput. 16, 151",
)  # fmt: skip
COUNTERPARTS = {
    "velocity_verlet": nh.integrators["verlet"], "omelyan": nh.integrators["omelyan_v5"],
    "yoshida": nh.integrators["bcss_s3"].role("kick"), "mclachlan": MINIMAL,
}  # fmt: skip


@pytest.mark.parametrize("name", COUNTERPARTS)
def test_methods_are_those_of_blackjax(name):
    tableau = COUNTERPARTS[name]
    ours = moved(adapter.integrator(tableau), henon_heiles, 0.4, 25, [0.3, 0.1], [-0.2, 0.25])
    expected = moved(getattr(theirs, name), henon_heiles, 0.4, 25, [0.3, 0.1], [-0.2, 0.25])
    # BlackJAX has 16 digits of each coefficient.
    np.testing.assert_allclose(ours.position, expected.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.momentum, expected.momentum, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("method", "more"), [("leapfrog", 0), ("babs7o7h", 0), ("abas5o6h", 1), ("bcss_s3", 1)])
def test_isokinetic_step_takes_one_gradient_a_stage(method, more):
    calls = []
    density = counted_density(gaussian, np.negative, calls)
    step = adapter.isokinetic_integrator(method)(density, 1.0)
    state = theirs.new_integrator_state(density, jnp.array([1.0, 0.5]), jnp.array([0.6, 0.8]))
    calls.clear()

    jax.block_until_ready(jax.lax.scan(lambda state, _: (step(state, 0.1)[0], None), state, None, length=6)[0])
    assert len(calls) == 6 * (nh.integrators[method].stages + more)


def test_isokinetic_verlet_is_that_of_blackjax():
    q, p = jnp.array([1.0, -0.5, 0.2]), jnp.array([0.0, 0.6, 0.8])
    state = theirs.new_integrator_state(quartic, q, p)
    ours, change = adapter.isokinetic_integrator("verlet")(quartic, 1.0)(state, 0.3)
    expected, their_change = theirs.isokinetic_velocity_verlet(quartic, 1.0)(state, 0.3)
    for mine, other in zip((*ours, change), (*expected, their_change), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-14)


def test_state_of_init_takes_a_fresh_gradient():
    factory = adapter.integrator("babs7o7h")
    algorithm = blackjax.hmc(gaussian, 0.5, jnp.ones(2), 3, integrator=factory)
    state, _ = jax.jit(algorithm.step)(jax.random.PRNGKey(0), algorithm.init(jnp.array([1.0, 0.5])))
    fresh = algorithm.init(state.position + 2.0)
    np.testing.assert_allclose(fresh.logdensity_grad, -(state.position + 2.0), rtol=1e-15)


def test_methods_that_only_blackjax_refuses():
    with pytest.raises(SettingError, match="it is not symmetric"):
        adapter.integrator("ruth_s3o3")
    with pytest.raises(SettingError, match="quadratic kinetic energy"):
        adapter.isokinetic_integrator("srkn_b11")
