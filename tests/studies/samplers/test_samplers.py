"""Samplers: targets, exact Gaussians, chains, effective samples and gains, against closed forms and other programs."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.numerics.compiled import Normal
from nearharmonic_studies.samplers import targets
from nearharmonic_studies.samplers.results import reduction
from nearharmonic_studies.samplers.run import MADE, Proposals, _squares, methods_of, tuned
from nearharmonic_studies.samplers.settings import TARGETS, SamplersSettings

# --- Targets of samplers: gradients, energies, published references, and chains of another library.


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_gradients_are_the_derivatives_of_the_potential(name):
    """Central differences along a random direction: rounding 1e-16 U / h and truncation h^2 of it."""
    target, random = MADE[name](25), np.random.default_rng(1)
    q, step, out = (scale * random.normal(size=target.dimension) for scale in (0.5, 1e-5, 1))
    target.gradient(q, out)
    unused = np.empty_like(out)
    slope = (target.gradient(q + step, unused) - target.gradient(q - step, unused)) / 2
    assert slope == pytest.approx(float(out @ step), rel=1e-6)


def energy(q):
    """U of a lattice by shifted arrays."""
    field = q.reshape(round(q.size**0.5), -1)
    squares = sum((np.roll(field, 1, axis) - field) ** 2 for axis in (0, 1))
    return (squares / 2 + targets.MASS * field**2 / 2 + targets.COUPLING * field**4 / 4).sum()


@pytest.mark.slow
def test_energy_of_the_lattice_is_that_of_shifted_arrays():
    target, field = MADE["lattice"](36), np.random.default_rng(2).normal(size=36)
    assert target.gradient(field, np.empty(36)) == pytest.approx(energy(field), rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("name", targets.REFERENCES)
def test_posteriors_have_the_published_means_and_squares(name):
    """Errors of both add in squares; 5 of them, for at most ten numbers."""
    target, reference = MADE[name](0), targets.REFERENCES[name]
    loop, means = targets.loop_for(target), []
    for k in range(8):
        warm = targets.run(target, loop, nh.integrators["leapfrog"], 0.2, 1.0, target.start(Normal([8, k])),
                   targets.chance(Normal([9, k]), 500, target.dimension))  # fmt: skip
        drawn = targets.chance(Normal([10, k]), 3000, target.dimension)
        sampled = targets.run(target, loop, nh.integrators["bcss_s4"], 1.0, 2.0, warm.last, drawn)
        means.append(sampled.observed.mean(axis=0))
    published = [*reference.mean.values(), *reference.square.values()]
    values, errors = np.array(published).T
    own = np.std(means, axis=0, ddof=1) / 8**0.5
    assert (np.abs(np.mean(means, axis=0) - values) < 5 * np.hypot(own, errors)).all()


@pytest.mark.slow
def test_tuning_finds_the_least_of_the_grid():
    """On a posterior of three parameters the smallest step of the grid is never the best."""
    target, settings = MADE["mesquite"](0), SamplersSettings(points=3, tuning=100, chains=8)
    starts = [target.start(Normal([3, k])) for k in range(8)]
    methods = {"leapfrog": nh.integrators["leapfrog"]}
    (place,) = tuned(target, targets.loop_for(target), methods, starts, settings).values()
    assert place.tau > 0.15 / target.highest
    assert place.length in target.lengths


# --- Samplers: exact Gaussians, chains, effective samples and gains, against closed forms and other programs.

#: A quartic target whose coordinates are the same oscillator but for their frequencies.
QUARTIC = targets.quartic(20)
LOOP = targets.loop_for(QUARTIC)


def leapfrog_matrix(h, steps):
    """Powers of leapfrog's step of an oscillator, which begins with a kick, by numpy."""
    return np.linalg.matrix_power(np.array([[1 - h * h / 2, h], [-h * (1 - h * h / 4), 1 - h * h / 2]]), steps)


def test_matrix_of_a_trajectory_is_that_of_leapfrog():
    angles = np.array([0.1, 0.7, 1.9])
    found = targets.power(targets.steps_matrix(nh.integrators["leapfrog"], angles), 13)
    assert found == pytest.approx(np.array([leapfrog_matrix(h, 13) for h in angles]), rel=1e-12)


@pytest.mark.slow
def test_gaussian_acceptance_and_jumps_are_those_of_random_proposals():
    """2e5 proposals of 30 modes: 5 standard errors of the means."""
    angles, random = np.linspace(0.3, 1.7, 30), np.random.default_rng(1)
    matrices = np.array([leapfrog_matrix(h, 4) for h in angles])
    acceptance, jumps = targets.moments(matrices, 1)
    z = random.normal(size=(200_000, 30, 2))
    after = np.einsum("kij,nkj->nki", matrices, z)
    accepted = np.minimum(1, np.exp(-((after**2).sum(axis=(1, 2)) - (z**2).sum(axis=(1, 2))) / 2))
    assert 0.1 < acceptance < 0.9
    assert abs(accepted.mean() - acceptance) < 5 * accepted.std() / len(z) ** 0.5
    squares = accepted[:, None] * (after[..., 0] - z[..., 0]) ** 2 / 2
    assert (np.abs(squares.mean(axis=0) - jumps) < 5 * squares.std(axis=0) / len(z) ** 0.5).all()


@pytest.mark.slow
def test_gaussian_gradients_are_those_of_a_chain():
    """A chain of the package on the Gaussian, b = 0, at the step and length of the exact result: 5 standard errors."""
    target = targets.quartic(100, strength=0.0)
    on, tau, length = targets.spectrum(100), 0.8, 6.0
    _, exact = targets.efficiency(nh.integrators["bcss_s4"], 4 * tau, length, on)
    drawn = targets.chance(Normal([1]), 4000, 100)
    start = target.start(Normal([2]))
    chain = targets.run(target, targets.loop_for(target), nh.integrators["bcss_s4"], 4 * tau, length, start, drawn)
    accepted = np.minimum(1, np.exp(-chain.changes))
    assert abs(chain.acceptance() - exact) < 5 * accepted.std() / 4000**0.5 + 2e-3  # nine lengths for all


def autoregressive(random, correlation, shape):
    """Chains of variance 1 whose neighbours have this correlation."""
    noise = random.normal(size=shape) * (1 - correlation**2) ** 0.5
    chains = np.empty_like(noise)
    chains[:, 0] = random.normal(size=shape[0])
    for k in range(1, shape[1]):
        chains[:, k] = correlation * chains[:, k - 1] + noise[:, k]
    return chains


@pytest.mark.parametrize("correlation", [0.9, 0.3, -0.5])
def test_autocorrelation_time_is_that_of_an_autoregressive_chain(correlation):
    """(1 + r)/(1 - r) for lag-1 correlation r; 40 chains of 2000 have errors of a few percent."""
    chains = autoregressive(np.random.default_rng(4), correlation, (40, 2000))
    found = targets.time_of(targets.covariances(chains).mean(axis=0))
    assert found == pytest.approx((1 + correlation) / (1 - correlation), rel=0.06)


def test_as_many_lags_are_formed_as_the_sums_need():
    """With and without each chain the time is the same as with all lags, to rounding."""
    for correlation, fewer in ((0.3, True), (0.995, False)):
        chains = autoregressive(np.random.default_rng(6), correlation, (6, 3000))
        found, every = targets.enough(chains), targets.covariances(chains)
        assert (found.shape[1] < every.shape[1]) == fewer
        for kept in (slice(None), slice(1, None), slice(0, -1)):
            one, other = (targets.time_of(times[kept].mean(axis=0)) for times in (found, every))
            assert one == pytest.approx(other, rel=1e-12)


@pytest.mark.slow
def test_standard_error_is_the_spread_of_repeated_measurements():
    """A spread of 80 repetitions has an error of 8 %; the jackknife errs on the large side by up to a third."""
    random = np.random.default_rng(5)
    values = [targets.costs(autoregressive(random, 0.7, (16, 400))[..., None], np.ones(16)) for _ in range(80)]
    spread = np.std([one[0] for one in values])
    assert 0.84 < np.mean([targets.error_of(one) for one in values]) / spread < 1.4


@pytest.mark.slow
def test_energy_errors_of_a_proposal_are_those_of_the_package():
    """A trajectory of 6 steps by ``nh.integrate``; both round about ten times a force."""
    n, tau = 3, 0.9
    target = targets.quartic(n)
    frequencies = 10.0 ** -(1 - (np.arange(n) + 0.5) / n)
    for name in ("leapfrog", "bcss_s4", "babs7o7h"):
        drawn = targets.Chance(np.array([[0.3, -1.1, 0.7]]), np.array([np.inf]), np.array([1.0]))
        start = np.array([2.0, -1.0, 0.5])
        chain = targets.run(target, targets.loop_for(target), nh.integrators[name], tau, 6 * tau, start, drawn)

        def potential(q):
            return sum((w * x) ** 2 / 2 + (w * x) ** 4 / 4 for w, x in zip(frequencies, q, strict=True))

        system = nh.System(name="quartics", V=potential, q0=start, p0=drawn.momenta[0], t_end=6 * tau)
        found = nh.integrate(system, name, tau, t_end=6 * tau, summation="plain")
        assert chain.last == pytest.approx(found.q.values[-1], rel=1e-13, abs=1e-14)
        assert chain.gradients == 6 * nh.integrators[name].stages


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["leapfrog", *(pytest.param(name, marks=pytest.mark.slow) for name in ("bcss_s4", "babs7o7h"))]
)
def test_chains_leave_the_moments_of_the_quartic_right(name):
    """<x^2> and <x^4> of exp(-x^2/2 - x^4/4) by quadrature, from means of 8 chains: 5 standard errors."""
    with mpmath.workdps(20):
        moment = [mpmath.quad(lambda x, m=m: x**m * mpmath.exp(-(x**2) / 2 - x**4 / 4), [-8, 0, 8]) for m in (0, 2, 4)]
    frequencies = 10.0 ** -(1 - (np.arange(20) + 0.5) / 20)
    means = []
    for k in range(8):
        q, found = QUARTIC.start(Normal([6, k])), []
        method = nh.integrators[name]
        for part in range(200):  # the state after each 10 proposals
            drawn = targets.chance(Normal([7, k, part]), 10, 20)
            q = targets.run(QUARTIC, LOOP, method, 0.5 * method.stages, 6.0, q, drawn).last
            found.append([np.mean((frequencies * q) ** m) for m in (2, 4)])
        means.append(np.mean(found, axis=0))
    error = np.std(means, axis=0, ddof=1) / 8**0.5
    exact = np.array([float(moment[1] / moment[0]), float(moment[2] / moment[0])])
    assert (error / exact < 0.03).all()
    assert (np.abs(np.mean(means, axis=0) - exact) < 5 * error).all()


@pytest.mark.slow
def test_starts_have_the_quantiles_of_the_quartic():
    for strength, temperature in ((0.0, 1.0), (1.0, 1.0), (2.0, 4.0)):
        (x,) = targets.quantiles(strength, np.array([0.83]), temperature)

        def density(y, b=strength, t=temperature):
            return mpmath.exp(-(y**2 / 2 + b * y**4 / 4) / t)

        below, all_ = (mpmath.quad(density, [-20, 0, end]) for end in (float(x), 20))
        assert float(below / all_) == pytest.approx(0.83, abs=1e-5)


# A drift first, and a kick.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["bcss_s4", pytest.param("predescu_s3", marks=pytest.mark.slow)])
def test_squared_errors_of_the_search_are_those_of_gaussian_starts(name):
    """For b = 0: <dH^2> = g + 3 g^2/4 with |M|^2 = 2 + g. 40000 even starts with weights err by 3 % at most."""
    proposals, method, tau = Proposals(1, 40_000, (0.0,)), nh.integrators[name], 0.5
    outer, inner = (np.array(row) for row in method.rows_double())
    found = _squares(
        method.first == "kick", outer, inner, method.stages, np.array([tau]), proposals.strengths,
        proposals.frequencies, proposals.x, proposals.p, proposals.lengths, proposals.weights,
    )  # fmt: skip
    counts = np.rint(proposals.lengths / (method.stages * tau)).astype(int)
    steps = targets.steps_matrix(method, method.stages * tau * proposals.frequencies)
    squares = [targets.power(step[None], count)[0] for step, count in zip(steps, counts, strict=True)]
    g = np.array([(one**2).sum() - 2 for one in squares])
    assert found[0, 0] == pytest.approx((g + 0.75 * g * g).mean(), rel=0.03)


def test_best_role_of_each_number_of_stages_is_kept():
    runs = [
        xr.Dataset(
            {"objective": ((), value), "unknowns": ("unknown", np.full(stages - 1, 0.2))},
            attrs={"family": f"{stages}_{first}"},
        )
        for stages, first, value in ((3, "drift", -0.1), (3, "kick", -0.2), (4, "kick", -0.1), (4, "drift", -0.3))
    ]
    assert {name: one.first for name, one in methods_of(runs).items()} == {
        "searched_s3": "kick", "searched_s4": "drift",
    }  # fmt: skip


def test_gains_are_ratios_with_paired_intervals():
    """Equal scatter of two methods on the same chains leaves their ratio without error."""
    scatter = np.array([0.0, 0.1, -0.1])
    runs = xr.Dataset(
        {"cost": (("integrator", "part"), [4 + scatter, 3 + scatter, 2.5 + scatter])},
        coords={"integrator": ["leapfrog", "bcss_s4", "searched_s4"]},
    )
    found = reduction.of(runs, over="part")
    assert found.gain.values == pytest.approx(np.exp([0, 1, 1.5]))
    assert found.gain_low.values == pytest.approx(found.gain_high.values)
    assert found.over_best.values == pytest.approx(np.exp([-1, 0, 0.5]))
    assert found.best.item() == "bcss_s4"
    assert np.log(found.cost_high / found.cost_low).values == pytest.approx(2 * 12.706 * 0.1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"integrators": ("leapfrog", "mclachlan_atela_2")}, "symmetric methods"),
        ({"integrators": ("leapfrog", "rowlands")}, "without modified potentials"),
        ({"targets": ("quartik",)}, "Did you mean 'quartic'"),
        ({"families": ("4_kik",)}, "Did you mean '4_kick'"),
    ],
)
def test_settings_that_cannot_run_are_named(changes, words):
    with pytest.raises(NearharmonicError, match=words):
        replace(SamplersSettings(), **changes).check((), ())
