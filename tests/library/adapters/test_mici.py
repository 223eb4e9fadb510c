"""Methods inside mici: trajectories, gradients per step, reversibility, and moments of posteriors."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mici", reason="mici is not installed")

import mici
from mici.integrators import (
    BCSSFourStageIntegrator,
    BCSSThreeStageIntegrator,
    BCSSTwoStageIntegrator,
    LeapfrogIntegrator,
)
from mici.states import ChainState
from mici.systems import EuclideanMetricSystem, GaussianEuclideanMetricSystem

import nearharmonic as nh
from nearharmonic.adapters.mici import integrator
from nearharmonic.errors import SettingError, UnknownNameError

#: Kick first and drift first; the last two are not symmetric.
METHODS = ("leapfrog", "babs7o7h", "trained_light", "aba864", "abas5o6h", "mclachlan_atela_3", "ruth_s3o3")
EPS = 2.0**-52


class Potential:
    """A potential and its gradient, which counts its calls."""

    def __init__(self, value, gradient):
        self.value, self._gradient, self.calls = value, gradient, 0

    def gradient(self, q):
        self.calls += 1
        return self._gradient(q)

    def system(self, kind=EuclideanMetricSystem, dimension=2, **options):
        options.setdefault("metric", np.ones(dimension))  # older versions of mici do not know the size of their default
        return kind(neg_log_dens=self.value, grad_neg_log_dens=self.gradient, **options)


def henon_heiles():
    return Potential(
        lambda q: q @ q / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3,
        lambda q: np.array([q[0] + 2 * q[0] * q[1], q[1] + q[0] ** 2 - q[1] ** 2]),
    )


def gaussian():
    return Potential(lambda q: q @ q / 2, lambda q: q)


def quartic():
    return Potential(lambda q: np.sum(q**4) / 4, lambda q: q**3)


def start(direction=1):
    return ChainState(pos=np.array([0.3, 0.0]), mom=np.array([0.0, 0.4]), dir=direction)


def after(steps, stepper, state):
    for _ in range(steps):
        state = stepper.step(state)
    return state


@pytest.mark.parametrize("method", METHODS)
def test_trajectory_is_that_of_integrate(method):
    state = after(80, integrator(henon_heiles().system(), 0.25, method), start())
    ours = nh.integrate("henon_heiles", method, tau=0.25, t_end=20, summation="plain")
    # Each of 80 (2 s + 1) moves rounds twice, and neighbours part by a factor below ten in this time.
    tolerance = 80 * (2 * nh.integrators[method].stages + 1) * 10 * EPS
    np.testing.assert_allclose(state.pos, ours.q.values[-1], rtol=0, atol=tolerance)
    np.testing.assert_allclose(state.mom, ours.p.values[-1], rtol=0, atol=tolerance)


@pytest.mark.parametrize("method", METHODS)
def test_step_evaluates_one_gradient_per_stage(method):
    potential = henon_heiles()
    stepper = integrator(potential.system(), 0.25, method)
    state = after(1, stepper, start())
    first = potential.calls
    assert first == sum(float(kick) != 0 for kick in nh.integrators[method].kick)
    after(20, stepper, state)
    assert potential.calls - first == 20 * nh.integrators[method].stages


def test_assigned_position_gets_its_own_gradient():
    stepper = integrator(henon_heiles().system(), 0.25, "babs7o7h")
    moved = after(3, stepper, start())
    moved.pos, moved.mom = np.array([0.1, -0.2]), 1.5 * moved.mom
    fresh = ChainState(pos=moved.pos.copy(), mom=moved.mom.copy(), dir=1)
    assert np.array_equal(stepper.step(moved).mom, stepper.step(fresh).mom)


@pytest.mark.parametrize("system", [EuclideanMetricSystem, GaussianEuclideanMetricSystem])
@pytest.mark.parametrize("method", METHODS)
def test_step_backwards_undoes_step_forwards(method, system):
    stepper = integrator(quartic().system(system), 0.2, method)
    state = after(10, stepper, start())
    state.dir = -1
    state = after(10, stepper, state)
    tolerance = 20 * (2 * nh.integrators[method].stages + 1) * 10 * EPS  # as above
    np.testing.assert_allclose(state.pos, start().pos, rtol=0, atol=tolerance)
    np.testing.assert_allclose(state.mom, start().mom, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("method", "own"),
    [
        ("leapfrog", LeapfrogIntegrator),
        ("bcss_s2", BCSSTwoStageIntegrator),
        (nh.integrators["bcss_s3"].role("kick"), BCSSThreeStageIntegrator),
        (nh.integrators["bcss_s4"].role("kick"), BCSSFourStageIntegrator),
    ],
    ids=("leapfrog", "bcss_s2", "bcss_s3", "bcss_s4"),
)
def test_integrator_of_mici_takes_the_same_steps(method, own):
    system = henon_heiles().system()
    ours, theirs = (after(80, stepper, start()) for stepper in (integrator(system, 0.25, method), own(system, 0.25)))
    tolerance = 80 * 9 * 10 * EPS  # moves, roundings and growth as above; mici computes its middle coefficients
    np.testing.assert_allclose(ours.pos, theirs.pos, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.mom, theirs.mom, rtol=0, atol=tolerance)


def test_metric_is_the_mass_of_each_coordinate():
    masses = np.array([2.0, 0.5])
    stepper = integrator(quartic().system(metric=masses), 0.2, "abas5o6h")
    state = after(1, stepper, start())
    q, p = start().pos, start().mom
    tableau = nh.integrators["abas5o6h"]
    for c_drift, c_kick in zip(tableau.drift, (*tableau.kick, "0"), strict=True):
        q = q + float(c_drift) * 0.2 * p / masses
        p = p - float(c_kick) * 0.2 * q**3
    np.testing.assert_allclose(state.pos, q, rtol=0, atol=22 * EPS)  # eleven moves of two roundings, numbers below 1
    np.testing.assert_allclose(state.mom, p, rtol=0, atol=22 * EPS)


@pytest.mark.parametrize(("method", "order"), [("leapfrog", 2), ("babs7o7h", 4), ("aba864", 4), ("srkn_a14", 6)])
def test_gaussian_splitting_has_the_order_of_method(method, order):
    system = quartic().system(GaussianEuclideanMetricSystem)

    def error(step):
        state = after(round(3.2 / step), integrator(system, step, method), start())
        return abs(system.h(state) - system.h(start()))

    assert error(0.4) / error(0.2) > 2 ** (order - 0.5)  # 2^order as the step vanishes


def moments(potential, method, step, kind=EuclideanMetricSystem):
    """Chain of HMC: positions, shape (transitions, dimension)."""
    system = potential.system(kind, dimension=8)
    stepper = integrator(system, step, method)
    rng = np.random.default_rng(1501)
    sampler = mici.samplers.StaticMetropolisHMC(system, stepper, rng, n_step=4)
    starts = [ChainState(pos=rng.standard_normal(8), mom=None, dir=1)]
    options = {"monitor_stats": [], "display_progress": False, "trace_funcs": [lambda state: {"pos": state.pos}]}
    found = sampler.sample_chains(n_warm_up_iter=100, n_main_iter=400, init_states=starts, adapters=[], **options)
    return np.concatenate([chain[:, i] for chain in found.traces["pos"] for i in range(8)])


def check_moment(values, expected):
    """Check a mean within five of its standard errors, from means of batches, which are longer than correlations."""
    batches = values[: len(values) // 50 * 50].reshape(50, -1).mean(axis=1)
    assert abs(batches.mean() - expected) < 5 * batches.std(ddof=1) / np.sqrt(50)


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "mclachlan_atela_3"])
def test_chain_has_the_moments_of_gaussian_posterior(method):
    chain = moments(gaussian(), method, 0.6)
    check_moment(chain, 0)
    check_moment(chain**2, 1)
    check_moment(chain**4, 3)


@pytest.mark.parametrize("kind", [EuclideanMetricSystem, GaussianEuclideanMetricSystem])
def test_chain_has_the_moments_of_quartic_posterior(kind):
    # The Gaussian system adds q.q/2 to what it is given. Density exp(-q^4/4): E q^4 = 1, by parts.
    euclidean = kind is EuclideanMetricSystem
    given = quartic() if euclidean else Potential(lambda q: np.sum(q**4) / 4 - q @ q / 2, lambda q: q**3 - q)
    chain = moments(given, "babs7o7h", 0.5, kind)
    check_moment(chain, 0)
    check_moment(chain**4, 1)


def test_step_size_adapter_sets_the_step():
    system = gaussian().system()
    stepper = integrator(system, None, "babs7o7h")
    rng = np.random.default_rng(1)
    sampler = mici.samplers.StaticMetropolisHMC(system, stepper, rng, n_step=3)
    states = [ChainState(pos=rng.standard_normal(2), mom=None, dir=1)]
    adapters = [mici.adapters.DualAveragingStepSizeAdapter(0.8)]
    sampler.sample_chains(
        n_warm_up_iter=50, n_main_iter=10, init_states=states, adapters=adapters, display_progress=False
    )
    assert stepper.step_size > 0


def test_integrator_can_be_pickled_for_parallel_chains():
    system = EuclideanMetricSystem(neg_log_dens=np.sum, grad_neg_log_dens=np.sign)
    copy = pickle.loads(pickle.dumps(integrator(system, 0.25, "babs7o7h")))
    assert copy.step_size == 0.25
    assert copy.method.tableau == nh.integrators["babs7o7h"]


@pytest.mark.parametrize("step", [0, -0.1, np.nan, np.inf, True, "fast", [0.1]])
def test_bad_step_raises_clear_error(step):
    with pytest.raises(SettingError, match="step = "):
        integrator(quartic().system(), step, "leapfrog")


def test_bad_method_raises_clear_error():
    with pytest.raises(UnknownNameError, match="babs7o7h"):
        integrator(quartic().system(), 0.1, "babs7o7")
    with pytest.raises(SettingError, match="mici"):
        integrator(quartic().system(), 0.1, "chin_4a")


def test_system_without_explicit_flows_is_refused():
    riemannian = mici.systems.DenseRiemannianMetricSystem(
        neg_log_dens=np.sum, metric_func=np.diag, grad_neg_log_dens=np.sign, vjp_metric_func=np.diag
    )
    constrained = mici.systems.DenseConstrainedEuclideanMetricSystem(
        neg_log_dens=np.sum, constr=np.sin, grad_neg_log_dens=np.sign, jacob_constr=np.cos, mhp_constr=np.cos
    )
    for system in (riemannian, constrained, None):
        with pytest.raises(SettingError, match="flows of h1 and h2"):
            integrator(system, 0.1, "leapfrog")


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "aba864"])
def test_force_that_depends_on_momenta_is_refused(method):
    class Friction(EuclideanMetricSystem):
        drag = 0.1

        def dh1_dpos(self, state):
            return state.pos + self.drag * (state.mom - state.mom[::-1]) * (state.pos[0] < 0.2)

    def system():
        return Friction(neg_log_dens=lambda q: q @ q / 2, grad_neg_log_dens=lambda q: q, metric=np.ones(2))

    with pytest.raises(SettingError, match="depends on the momenta"):
        after(20, integrator(system(), 0.25, method), start())
    Friction.drag = 0.0
    after(20, integrator(system(), 0.25, method), start())


def test_tableau_of_the_user_runs():
    own = replace(nh.integrators["leapfrog"], name="mine", aliases=())
    ours, theirs = (after(3, integrator(henon_heiles().system(), 0.1, m), start()) for m in (own, "verlet"))
    assert np.array_equal(ours.pos, theirs.pos)
