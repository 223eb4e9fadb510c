"""Methods inside mici: reversibility, orders and refusals."""

import pickle

import numpy as np
import pytest

pytest.importorskip("mici", reason="mici is not installed")

import mici
from mici.states import ChainState
from mici.systems import EuclideanMetricSystem, GaussianEuclideanMetricSystem

import nearharmonic as nh
from nearharmonic.adapters.mici import integrator
from nearharmonic.errors import SettingError

#: Kick first and drift first; the last two are not symmetric.
METHODS = ("leapfrog", "babs7o7h", "trained_light", "aba864", "abas5o6h", "mclachlan_atela_3", "ruth_s3o3")
EPS = 2.0**-52


class Potential:
    """A potential and its gradient."""

    def __init__(self, value, gradient):
        self.value, self.gradient = value, gradient

    def system(self, kind=EuclideanMetricSystem, dimension=2, **options):
        options.setdefault("metric", np.ones(dimension))  # older versions of mici do not know the size of their default
        return kind(neg_log_dens=self.value, grad_neg_log_dens=self.gradient, **options)


def quartic():
    return Potential(lambda q: np.sum(q**4) / 4, lambda q: q**3)


def start():
    return ChainState(pos=np.array([0.3, 0.0]), mom=np.array([0.0, 0.4]), dir=1)


def after(steps, stepper, state):
    for _ in range(steps):
        state = stepper.step(state)
    return state


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


@pytest.mark.parametrize(("method", "order"), [("leapfrog", 2), ("babs7o7h", 4), ("aba864", 4), ("srkn_a14", 6)])
def test_gaussian_splitting_has_the_order_of_method(method, order):
    system = quartic().system(GaussianEuclideanMetricSystem)

    def error(step):
        state = after(round(3.2 / step), integrator(system, step, method), start())
        return abs(system.h(state) - system.h(start()))

    assert error(0.4) / error(0.2) > 2 ** (order - 0.5)  # 2^order as the step vanishes


def test_step_size_adapter_sets_the_step():
    system = Potential(lambda q: q @ q / 2, lambda q: q).system()
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
