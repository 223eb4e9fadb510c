"""Chains of BlackJAX and mici as the table of samplers has them: gradients, acceptance and targets."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("blackjax", reason="BlackJAX is not installed", exc_type=ImportError)
pytest.importorskip("mici", reason="mici is not installed")

import jax
import jax.numpy as jnp

import nearharmonic as nh
from nearharmonic_studies.samplers.targets import frequencies_of, moments, power, quartic, steps_matrix
from support.oracles.counted_jax import counted_density
from support.results.page_inputs import benchmark

pytestmark = pytest.mark.slow  # JAX compiles each sampler

#: Modes of the Gaussian.
N = 20


@pytest.fixture
def chains():
    """Module of the chains, with JAX in double precision."""
    before = jax.config.jax_enable_x64
    module = benchmark("chains_of_libraries")
    jax.config.update("jax_enable_x64", True)
    yield module
    jax.config.update("jax_enable_x64", before)


def problem(density=None, chains=4):
    """A Gaussian with starts in equilibrium."""
    on, random = quartic(N, strength=0.0), np.random.default_rng(2)
    starts = random.normal(size=(chains, N)) / frequencies_of(N)
    return SimpleNamespace(on=on, density=density, width=20.0, length=16.0, starts=starts,
                           observed=lambda kept, potentials: potentials[..., None])  # fmt: skip


@pytest.mark.parametrize("name", ["leapfrog", "babs7o7h"])
@pytest.mark.parametrize("kind", ["Nuts", "Mclmc"])
def test_gradients_of_blackjax_are_those_of_a_counter(kind, name, chains):
    calls, method = [], nh.integrators[name]
    squares = frequencies_of(N) ** 2
    given = problem(counted_density(lambda q: -(jnp.asarray(squares) * q * q).sum() / 2, lambda q: -squares * q, calls))
    sampler = getattr(chains, kind)
    first, one = sampler.functions(given, sampler.own if name == "leapfrog" else sampler.adapter(method))
    state = jax.block_until_ready(first(jnp.asarray(given.starts[0]), jax.random.PRNGKey(1)))
    calls.clear()
    tau, keys = 0.4 * method.stages, jax.random.split(jax.random.PRNGKey(3), 30)
    _, found = jax.block_until_ready(jax.jit(lambda s: jax.lax.scan(lambda s, key: one(s, key, tau), s, keys))(state))
    assert len(calls) == int(np.sum(found[-1])) * method.stages
    assert len(calls) >= 30 * method.stages


@pytest.mark.parametrize(("name", "tau"), [("leapfrog", 1.0), ("bcss_s4", 1.35), ("babs7o7h", 0.9)])
def test_acceptance_and_gradients_of_mici_are_exact_ones(name, tau, chains):
    """Means over numbers of steps, each as likely, against 20 blocks: 5 standard errors."""
    method, given = nh.integrators[name].role("kick"), problem()
    sampler = chains.Metropolis(given, method, 5)
    found = []
    for part in range(20):
        block, sampler.states = sampler.block(tau, 40, part)
        found.append((block.level, block.gradients.mean() / 40))
    low, high = (max(1, round(factor * given.length / (tau * method.stages))) for factor in (0.8, 1.2))
    counts = np.arange(low, high + 1)
    step = steps_matrix(method, tau * method.stages * frequencies_of(N))
    exact = np.mean([moments(power(step, int(count)), 1)[0] for count in counts]), counts.mean() * method.stages
    error = np.std(found, axis=0, ddof=1) / 20**0.5
    # A chain without a gradient at its start takes one more in each block.
    assert 0.1 < exact[0] < 0.99
    assert error[0] < 0.02
    assert (np.abs(np.mean(found, axis=0) - exact) < 5 * error + np.array([0, 1 / 40])).all()


@pytest.mark.parametrize("name", ["gaussian", "quartic", "eight_schools", "gp_regr", "mesquite"])
def test_densities_for_jax_are_those_of_the_targets(name, chains):
    """Gradients to rounding, and potentials but for a constant."""
    given = chains.Problem(name, 2)
    potentials, logs = [], []
    for q in given.starts:
        out = np.empty_like(q)
        potentials.append(given.on.gradient(q, out))
        logs.append(float(given.density(jnp.asarray(q))))
        slopes = np.asarray(jax.grad(given.density)(jnp.asarray(q)))
        np.testing.assert_allclose(-slopes, out, rtol=1e-9, atol=1e-10 * np.abs(out).max())
    assert potentials[1] - potentials[0] == pytest.approx(logs[0] - logs[1], rel=1e-9)
