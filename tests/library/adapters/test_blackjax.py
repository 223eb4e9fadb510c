"""Methods in BlackJAX: its own integrators as oracles, gradients counted, posteriors sampled, and what is refused."""

from __future__ import annotations

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
from nearharmonic.errors import SettingError, UnknownNameError

#: Some hundreds of sums of terms of size 1, each rounded to 1.1e-16.
ROUNDING = 1e-13


@pytest.fixture(autouse=True, scope="module")
def _double_precision():
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


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


def stages(method):
    """The number of kicks, of which a first and a last one count as one."""
    tableau = nh.integrators[method]
    return len(tableau.kick) - (tableau.first == "kick")


def counted(calls):
    """A Gaussian log density that counts its gradients at run time."""

    @jax.custom_vjp
    def density(x):
        return gaussian(x)

    def host(x):
        calls.append(1)
        return np.asarray(-x)

    def forward(x):
        return gaussian(x), jax.pure_callback(host, jax.ShapeDtypeStruct(x.shape, x.dtype), x)

    density.defvjp(forward, lambda gradient, g: (g * gradient,))
    return density


@pytest.mark.parametrize("density", [gaussian, quartic, henon_heiles])
def test_verlet_is_velocity_verlet_of_blackjax(density):
    q, p = [0.3, 0.1], [-0.2, 0.25]
    ours = moved(adapter.integrator("verlet"), density, 0.1, 50, q, p)
    expected = moved(theirs.velocity_verlet, density, 0.1, 50, q, p)
    for mine, other in zip(ours, expected, strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=ROUNDING)


B = "0.1931833275037836"
#: McLachlan's method of two stages is not registered; BlackJAX has BCSS 3 with the kick first as its "yoshida".
MINIMAL = nh.Tableau(
    name="minimal", order=2, first="kick", kick=(B, "0.6136333449924328", B), drift=("0.5", "0.5"), digits=16,
    source="McLachlan (1995), SIAM J. Sci. Comput. 16, 151",
)  # fmt: skip
COUNTERPARTS = {
    "omelyan": nh.integrators["omelyan_v5"],
    "yoshida": nh.integrators["bcss_s3"].role("kick"),
    "mclachlan": MINIMAL,
}


@pytest.mark.parametrize("name", COUNTERPARTS)
def test_methods_are_those_of_blackjax(name):
    tableau = COUNTERPARTS[name]
    ours = moved(adapter.integrator(tableau), henon_heiles, 0.4, 25, [0.3, 0.1], [-0.2, 0.25])
    expected = moved(getattr(theirs, name), henon_heiles, 0.4, 25, [0.3, 0.1], [-0.2, 0.25])
    # BlackJAX has 16 digits of each coefficient.
    np.testing.assert_allclose(ours.position, expected.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.momentum, expected.momentum, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "abas5o6h", "srkn_a14"])
def test_states_are_those_of_nh_integrate(method):
    q0, p0 = [0.3, 0.1], [-0.2, 0.25]
    expected = nh.integrate("henon_heiles", method, 0.25, t_end=20, q0=q0, p0=p0, summation="plain", samples=1)
    end = moved(adapter.integrator(method), henon_heiles, 0.25, 80, q0, p0)
    np.testing.assert_allclose(end.position, expected.q.values[-1], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(end.momentum, expected.p.values[-1], rtol=0, atol=ROUNDING)
    value, gradient = jax.value_and_grad(henon_heiles)(end.position)
    np.testing.assert_allclose(end.logdensity, value, rtol=1e-14)
    np.testing.assert_allclose(end.logdensity_grad, gradient, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("method", "more"), [("leapfrog", 0), ("babs7o7h", 0), ("abas5o6h", 1), ("bcss_s3", 1)])
@pytest.mark.parametrize("isokinetic", [False, True])
def test_step_takes_one_gradient_a_stage(method, more, isokinetic):
    calls = []
    density = counted(calls)
    if isokinetic:
        step = adapter.isokinetic_integrator(method)(density, 1.0)
    else:
        step = adapter.integrator(method)(density, kinetic(2))
    state = theirs.new_integrator_state(density, jnp.array([1.0, 0.5]), jnp.array([0.6, 0.8]))
    calls.clear()

    def one(state, _):
        after = step(state, 0.1)
        return (after[0] if isokinetic else after), None

    jax.block_until_ready(jax.lax.scan(one, state, None, length=6)[0])
    assert len(calls) == 6 * (stages(method) + more)


@pytest.mark.parametrize("method", ["verlet", "babs7o7h", "abas5o6h", "trained_light"])
def test_negative_step_undoes_a_step(method):
    """NUTS extends its trajectory backwards by steps of -step_size."""
    factory = adapter.integrator(method)
    there = moved(factory, quartic, 0.5, 1, [1.0, -0.5], [0.3, 0.8])
    back = moved(factory, quartic, -0.5, 1, there.position, there.momentum)
    np.testing.assert_allclose(back.position, [1.0, -0.5], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(back.momentum, [0.3, 0.8], rtol=0, atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order"), [("verlet", 2), ("bcss_s3", 2), ("babs7o7h", 4), ("abas5o6h", 4)])
@pytest.mark.parametrize("isokinetic", [False, True])
def test_energy_error_has_order_of_method(method, order, isokinetic):
    errors = []
    for step_size in (0.05 * stages(method), 0.025 * stages(method)):
        steps = round(1.4 * 5 / step_size) // 5  # 1.4 units of time
        if isokinetic:
            step = adapter.isokinetic_integrator(method)(quartic, 1.0)
            state = theirs.new_integrator_state(quartic, jnp.array([1.0, -0.5, 0.2]), jnp.array([0.0, 0.6, 0.8]))
            change = 0.0
            for _ in range(steps):
                after, kinetic_change = step(state, step_size)
                change, state = change + kinetic_change - after.logdensity + state.logdensity, after
            assert float(jnp.linalg.norm(state.momentum)) == pytest.approx(1, abs=1e-14)
        else:
            start = moved(adapter.integrator(method), quartic, step_size, 0, [1.0, -0.5], [0.3, 0.8])
            end = moved(adapter.integrator(method), quartic, step_size, steps, [1.0, -0.5], [0.3, 0.8])
            energies = [0.5 * s.momentum @ s.momentum - s.logdensity for s in (start, end)]
            change = energies[1] - energies[0]
        errors.append(abs(float(change)))
    assert errors[0] > 1e-11  # above rounding
    # The next even order contributes at these steps; a method of another order is 2 away.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.8)


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


# Posteriors: data made by fixed generators, and moments by quadrature or in closed form.

EIGHT_SCHOOLS = np.array([28.0, 8, -3, 7, -1, 1, 18, 12]), np.array([15.0, 10, 16, 11, 9, 11, 10, 18])


def eight_schools(x):
    """Effects mu + tau z of schools, not centred: mu ~ N(0, 5), log tau ~ N(0, 1), z ~ N(0, 1)."""
    effects, errors = EIGHT_SCHOOLS
    mu, log_tau, z = 5 * x[0], x[1], x[2:]
    residuals = (effects - mu - jnp.exp(log_tau) * z) / errors
    return -0.5 * (x @ x + residuals @ residuals)


def moments_of_eight_schools():
    """Mean and variance of mu/5 and log tau by quadrature: given both, each effect is normal."""
    effects, errors = EIGHT_SCHOOLS
    m, s = np.meshgrid(np.linspace(-7, 7, 801), np.linspace(-7, 7, 801), indexing="ij")
    log = -(m**2 + s**2) / 2
    for y, sigma in zip(effects, errors, strict=True):
        variance = sigma**2 + np.exp(2 * s)
        log = log - (y - 5 * m) ** 2 / (2 * variance) - np.log(variance) / 2
    return on_grid(m, s, log)


def on_grid(x, y, log):
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    means = np.array([(weights * x).sum(), (weights * y).sum()])
    return means, np.array([(weights * x**2).sum(), (weights * y**2).sum()]) - means**2


def regression_data():
    generator = np.random.default_rng(5)
    x = generator.standard_normal(60)
    return x, (generator.random(60) < 1 / (1 + np.exp(-(0.5 + 1.2 * x)))).astype(float)


def logistic(w):
    """Logistic regression on generated data, with weights w ~ N(0, 4)."""
    x, y = regression_data()
    a = w[0] + w[1] * x
    return jnp.sum(y * a - jnp.logaddexp(0.0, a)) - w @ w / 8


def moments_of_logistic():
    a, b = np.meshgrid(np.linspace(-4, 5, 601), np.linspace(-4, 6, 601), indexing="ij")
    log = -(a**2 + b**2) / 8
    for x, y in zip(*regression_data(), strict=True):
        line = a + b * x
        log = log + y * line - np.logaddexp(0, line)
    return on_grid(a, b, log)


def banana(x):
    """x ~ N(0, 1) and y ~ N(x^2, 1)."""
    return -0.5 * (x[0] ** 2 + (x[1] - x[0] ** 2) ** 2)


def moments_of_gaussian():
    return np.zeros(2), np.ones(2)


def moments_of_quartic():
    """<x^2> of exp(-x^4/4) is 2 Gamma(3/4) / Gamma(1/4)."""
    return np.zeros(2), np.full(2, 2 * 1.2254167024651776 / 3.625609908221908)


def moments_of_banana():
    return np.array([0.0, 1.0]), np.array([1.0, 3.0])  # y = x^2 + e has mean 1 and variance 2 + 1


POSTERIORS = {
    "gaussian": (gaussian, moments_of_gaussian, 2, 1.5),
    "quartic": (quartic, moments_of_quartic, 2, 1.2),
    "eight_schools": (eight_schools, moments_of_eight_schools, 10, 1.0),
    "logistic": (logistic, moments_of_logistic, 2, 0.35),
    "banana": (banana, moments_of_banana, 2, 0.8),
}


def chains(build, start, draws):
    """Draws of 32 chains, the first fifth left out: (chain, draw, component)."""

    def chain(key):
        first, rest = jax.random.split(key)
        state = build.init(start + 0.1 * jax.random.normal(first, start.shape))

        def one(state, key):
            state, _ = build.step(key, state)
            return state, state.position

        return jax.lax.scan(one, state, jax.random.split(rest, draws))[1]

    return np.asarray(jax.jit(jax.vmap(chain))(jax.random.split(jax.random.PRNGKey(7), 32)))[:, draws // 5 :]


def check_moments(samples, means, variances):
    """Within six standard errors, which the 32 independent chains give: Student's t has 1e-6 beyond them."""
    samples = samples[..., : len(means)]
    for estimate, exact in ((samples, means), ((samples - means) ** 2, variances)):
        of_chains = estimate.mean(axis=1)
        error = of_chains.std(axis=0, ddof=1) / np.sqrt(len(of_chains))
        assert (error < 0.05 * np.sqrt(variances) * (1 + 4 * variances)).all()  # the test would see an error of a tenth
        np.testing.assert_array_less(np.abs(of_chains.mean(axis=0) - exact), 6 * error)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("posterior", "method"), [*((name, "babs7o7h") for name in POSTERIORS), ("banana", "abas5o6h")]
)
def test_hmc_samples_the_posterior(posterior, method):
    density, moments, dimension, step_size = POSTERIORS[posterior]
    build = blackjax.hmc(density, step_size, jnp.ones(dimension), 3, integrator=adapter.integrator(method))
    check_moments(chains(build, jnp.zeros(dimension), 2000), *moments())


@pytest.mark.slow
@pytest.mark.parametrize("posterior", ["eight_schools", "banana"])
def test_nuts_samples_the_posterior(posterior):
    density, moments, dimension, step_size = POSTERIORS[posterior]
    build = blackjax.nuts(density, step_size, jnp.ones(dimension), integrator=adapter.integrator("mclachlan_s4"))
    check_moments(chains(build, jnp.zeros(dimension), 1000), *moments())


@pytest.mark.slow
def test_mclmc_samples_a_gaussian():
    """MCLMC does not reject: its bias is that of the energy error, below 1e-3 at this step."""
    build = blackjax.mclmc(gaussian, L=2.0, step_size=0.7, integrator=adapter.isokinetic_integrator("mclachlan_s4"))
    first = build.init

    class Keyed:
        step = staticmethod(build.step)
        init = staticmethod(lambda position: first(position, jax.random.PRNGKey(1)))

    check_moments(chains(Keyed, jnp.ones(6), 4000), np.zeros(6), np.ones(6))


def test_unfit_methods_are_refused():
    with pytest.raises(UnknownNameError, match="'babs7o7h'"):
        adapter.integrator("babs7o7")
    with pytest.raises(SettingError, match="BlackJAX has no hook"):
        adapter.integrator("chin_4a")
    with pytest.raises(SettingError, match="cannot run in BlackJAX"):
        adapter.integrator("rowlands")
    with pytest.raises(SettingError, match="it is not symmetric"):
        adapter.integrator("ruth_s3o3")
    with pytest.raises(SettingError, match="quadratic kinetic energy"):
        adapter.isokinetic_integrator("srkn_b11")
