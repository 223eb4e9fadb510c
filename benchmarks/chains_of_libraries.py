"""Chains of samplers of BlackJAX and mici on the targets of the experiment on samplers, with their gradients counted.

A chain continues from block to block of proposals, so that the search for a step size and the measurement use one
compiled function. All methods begin with a kick: a step takes as many gradients as stages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import blackjax
import jax
import jax.numpy as jnp
import mici
import numpy as np
from blackjax.mcmc import integrators as theirs

import nearharmonic as nh
from nearharmonic.numerics.compiled import Normal
from nearharmonic_studies.samplers import targets as posteriors
from nearharmonic_studies.samplers.run import MADE, warmed
from nearharmonic_studies.samplers.settings import SamplersSettings
from nearharmonic_studies.samplers.targets import SLOW, STRENGTH, frequencies_of, loop_for, quartic

jax.config.update("jax_enable_x64", True)

#: Strength of the quartic term and dimensions of the products.
PRODUCTS = {"gaussian": (0.0, 1000), "quartic": (STRENGTH, 256)}
#: The mean length of trajectories of Hamiltonian Monte Carlo, over the highest frequency, and the range of the jitter.
LENGTHS = {"gaussian": 8.0, "quartic": 8.0, "eight_schools": 4.0, "gp_regr": 2.0, "mesquite": 2.0}
JITTER = (0.8, 1.2)


class Block(NamedTuple):
    """Proposals of several chains.

    Attributes
    ----------
    observed : (chains, c, observables) array
        Observables after each proposal.
    gradients : (chains,) array
        Gradients of each chain.
    level : float
        Mean acceptance; for MCLMC the mean squared energy error of a step for each dimension.
    """

    observed: np.ndarray
    gradients: np.ndarray
    level: float


class Problem:
    """A target with its log density for JAX, starts of chains, and the length scale of MCLMC.

    Attributes
    ----------
    on : Target
        The target of the experiment, whose compiled gradient mici takes.
    density : callable
        Log density for JAX.
    starts : (chains, n) array
        States from which chains begin.
    width : float
        Root of the sum of the variances of the coordinates.
    """

    def __init__(self, name: str, chains: int) -> None:
        settings = SamplersSettings(chains=chains)
        if name in PRODUCTS:
            strength, n = PRODUCTS[name]
            self.on = quartic(n, strength)
            if name == "gaussian":
                self.on = replace(self.on, name=name, label=f"Gaussian, {n} dimensions")
            self.density = product(n, strength)
            draws = np.array([self.on.start(Normal([1, 4, k])) for k in range(100)])
            self.width = float(np.sqrt(draws.var(axis=0).sum()))
        else:
            self.on, self.density = MADE[name](0), DENSITIES[name]()
            self.width = float(np.sqrt(self.on.dimension))  # coordinates have variances near 1
        loop = loop_for(self.on)
        self.starts = np.array([warmed(self.on, loop, settings, k) for k in range(chains)])
        self.length = LENGTHS[name] / self.on.highest

    def observed(self, positions: np.ndarray, potentials: np.ndarray) -> np.ndarray:
        """Observables (chains, c, o) of the first coordinates (chains, c, k) and of U (chains, c)."""
        found = np.empty((*potentials.shape, len(self.on.observables)))
        for place in np.ndindex(potentials.shape):
            self.on.observe(positions[place], potentials[place], found[place])
        return found


def product(n: int, strength: float) -> Callable:
    """Log density of a product of quartic oscillators."""
    frequencies = jnp.asarray(frequencies_of(n))

    def density(q):
        squares = (frequencies * q) ** 2
        return -jnp.sum(squares / 2 + strength * squares**2 / 4)

    return density


def eight_schools() -> Callable:
    """Log density of the model of eight schools."""
    shift, scale = posteriors.COORDINATES["eight_schools"]

    def density(q):
        mu, log_tau = shift[0] + scale[0] * q[8], shift[1] + scale[1] * q[9]
        tau = jnp.exp(log_tau)
        pulls = (q[:8] * tau + mu - posteriors.EFFECTS) / posteriors.ERRORS
        return -(pulls @ pulls + q[:8] @ q[:8]) / 2 - mu**2 / 50 - jnp.log1p(tau**2 / 25) + log_tau

    return density


def gp_regr() -> Callable:
    """Log density of the regression by a Gaussian process."""
    shift, scale = posteriors.COORDINATES["gp_regr"]
    y, places = jnp.asarray(posteriors.Y), jnp.arange(len(posteriors.Y))
    squares = (places[:, None] - places) ** 2

    def density(q):
        logs = shift + scale * q
        rho, alpha, sigma = jnp.exp(logs)
        kernel = alpha**2 * jnp.exp(-2 * squares / rho**2) + sigma * jnp.eye(len(y))
        root = jnp.linalg.cholesky(kernel)
        white = jax.scipy.linalg.solve_triangular(root, y, lower=True)
        likelihood = -white @ white / 2 - jnp.log(jnp.diag(root)).sum()
        return likelihood - 4 * rho + 25 * logs[0] - alpha**2 / 8 + logs[1] - sigma**2 / 2 + logs[2]

    return density


def mesquite() -> Callable:
    """Log density of the regression of the weight of leaves."""
    shift, scale = posteriors.COORDINATES["mesquite"]
    volume, weight = map(jnp.asarray, posteriors.mesquite_logarithms())

    def density(q):
        first, second, log_sigma = shift + scale * q
        rests = first + second * volume - weight
        return -rests @ rests * jnp.exp(-2 * log_sigma) / 2 - (len(volume) - 1) * log_sigma

    return density


DENSITIES = {"eight_schools": eight_schools, "gp_regr": gp_regr, "mesquite": mesquite}


class Nuts:
    """The No-U-Turn Sampler of BlackJAX, whose information has the steps of each proposal."""

    own = staticmethod(theirs.velocity_verlet)
    adapter = staticmethod(nh.adapters.blackjax.integrator)

    def __init__(self, problem: Problem, method: nh.Tableau, seed: int) -> None:
        self.problem, self.stages, self.key = problem, method.stages, jax.random.PRNGKey(seed)
        self.unit = 1 / problem.on.highest
        integrator = self.own if method.name == "leapfrog" else self.adapter(method)
        first, one = self.functions(problem, integrator)
        keys = jax.random.split(self.key, len(problem.starts))
        self.states = jax.vmap(first)(jnp.asarray(problem.starts), keys)

        def chain(state, keys, tau):
            return jax.lax.scan(lambda state, key: one(state, key, tau), state, keys)

        self.chains = jax.jit(jax.vmap(chain, in_axes=(0, 0, None)))

    @staticmethod
    def functions(problem: Problem, integrator: Callable) -> tuple[Callable, Callable]:
        """State of a position, and a proposal: its state, coordinates, log density, level and steps."""
        density, masses = problem.density, jnp.ones(problem.on.dimension)

        def one(state, key, tau):
            state, info = blackjax.nuts(density, tau, masses, integrator=integrator).step(key, state)
            return state, (state.position[:SLOW], state.logdensity, info.acceptance_rate, info.num_integration_steps)

        return lambda q, key: blackjax.nuts.init(q, density), one

    def block(self, tau: float, count: int, part: int) -> tuple[Block, object]:
        """Proposals with steps of ``tau`` per stage in units of the target, and the states after them."""
        keys = jax.random.split(jax.random.fold_in(self.key, part), (len(self.problem.starts), count))
        states, found = self.chains(self.states, keys, tau * self.unit * self.stages)
        positions, logs, levels, steps = map(np.asarray, found)
        return Block(self.problem.observed(positions, -logs), steps.sum(axis=1) * self.stages, levels.mean()), states


class Mclmc(Nuts):
    """Microcanonical Langevin Monte Carlo of BlackJAX, without acceptance."""

    own = staticmethod(theirs.isokinetic_velocity_verlet)
    adapter = staticmethod(nh.adapters.blackjax.isokinetic_integrator)

    def __init__(self, problem: Problem, method: nh.Tableau, seed: int) -> None:
        super().__init__(problem, method, seed)
        self.unit *= np.sqrt(problem.on.dimension)  # the velocity has norm 1

    @staticmethod
    def functions(problem: Problem, integrator: Callable) -> tuple[Callable, Callable]:
        density = problem.density

        def one(state, key, tau):
            algorithm = blackjax.mclmc(density, L=problem.width, step_size=tau, integrator=integrator)
            state, info = algorithm.step(key, state)
            level = jnp.where(info.nonans, info.energy_change**2 / problem.on.dimension, jnp.inf)
            return state, (state.position[:SLOW], state.logdensity, level, 1)

        return lambda q, key: blackjax.mclmc.init(q, density, key), one


class Metropolis:
    """Hamiltonian Monte Carlo of mici, with a random number of steps; the gradients are counted."""

    def __init__(self, problem: Problem, method: nh.Tableau, seed: int) -> None:
        self.problem, self.stages, self.seed, self.calls = problem, method.stages, seed, [0]
        self.unit, self.states = 1 / problem.on.highest, list(problem.starts)
        potential, calls = problem.on.gradient, self.calls  # mici copies its system with all methods of objects

        def gradient(q):
            """Gradient and U, of which mici keeps both."""
            calls[0] += 1
            out = np.empty_like(q)
            return out, potential(q, out)

        self.system = mici.systems.EuclideanMetricSystem(
            neg_log_dens=lambda q: potential(q, np.empty_like(q)), grad_neg_log_dens=gradient,
            metric=np.ones(problem.on.dimension),
        )  # fmt: skip
        if method.name == "leapfrog":
            self.integrator = mici.integrators.LeapfrogIntegrator(self.system)
        else:
            self.integrator = nh.adapters.mici.integrator(self.system, None, method)

    def sampler(self, rng: np.random.Generator) -> mici.samplers.HamiltonianMonteCarlo:
        """The sampler of mici with a length of trajectories."""
        step = self.integrator.step_size
        low, high = (max(1, round(factor * self.problem.length / step)) for factor in JITTER)
        # The upper end is exclusive in mici.
        return mici.samplers.RandomMetropolisHMC(self.system, self.integrator, rng, n_step_range=(low, high + 1))

    def block(self, tau: float, count: int, part: int) -> tuple[Block, object]:
        """Proposals with steps of ``tau`` per stage in units of the target, and the states after them."""
        self.integrator.step_size, self.calls[0] = float(tau * self.unit * self.stages), 0
        found = self.sampler(np.random.default_rng([self.seed, part])).sample_chains(
            n_warm_up_iter=0, n_main_iter=count, init_states=self.states, adapters=[], display_progress=False,
            trace_funcs=[self._traced],
        )  # fmt: skip
        kept, potentials, calls = (np.array(found.traces[name]) for name in ("kept", "U", "calls"))
        gradients = np.diff(calls[:, -1], prepend=0)  # chains run one after the other
        block = Block(self.problem.observed(kept, potentials), gradients, np.mean(found.statistics["accept_stat"]))
        return block, [state.pos for state in found.final_states]

    def _traced(self, state: mici.states.ChainState) -> dict[str, object]:
        return {"kept": state.pos[:SLOW].copy(), "U": self.system.neg_log_dens(state), "calls": self.calls[0]}


class Dynamic(Metropolis):
    """Hamiltonian Monte Carlo of mici that ends at U-turns and draws from the trajectory."""

    def sampler(self, rng: np.random.Generator) -> mici.samplers.HamiltonianMonteCarlo:
        return mici.samplers.DynamicMultinomialHMC(self.system, self.integrator, rng)


def with_level(sampler: Nuts | Metropolis, level: float, count: int, halvings: int) -> float:
    """Step size per stage, in units of the target, whose proposals have a level, by bisection of its logarithm.

    All steps have the same starts and random numbers. The acceptance falls with the step; the error of MCLMC rises.
    """
    low, high = 0.05, 4.0
    for _ in range(halvings):
        middle = float(np.sqrt(low * high))
        found = sampler.block(middle, count, 0)[0].level
        larger = found < level if isinstance(sampler, Mclmc) else found >= level  # false without a number
        low, high = (middle, high) if larger else (low, middle)
    return float(np.sqrt(low * high))


def measured_with(sampler: Nuts | Metropolis, tau: float, count: int, blocks: int) -> Block:
    """Blocks of proposals, one after the other."""
    found = []
    for part in range(1, blocks + 1):
        block, sampler.states = sampler.block(tau, count, part)
        found.append(block)
    return Block(
        np.concatenate([one.observed for one in found], axis=1),
        np.sum([one.gradients for one in found], axis=0),
        float(np.mean([one.level for one in found])),
    )
