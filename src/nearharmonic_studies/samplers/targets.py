"""Hamiltonian Monte Carlo: targets, chains and their effective samples, and Gaussians exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, exp, log
from nearharmonic.numerics.compiled import Normal, compiled, exponential, logarithm
from nearharmonic.numerics.portable import Floats


# --- A target exp(-U) of Hamiltonian Monte Carlo with unit masses: gradient, observables and starts.
@dataclass(frozen=True, kw_only=True)
class Target:
    """A target.

    ``name``, ``label``: name, and name in figures. ``dimension``: number of coordinates, n. ``highest``: a frequency
    near the highest one, in whose unit step sizes are given. ``lengths``: times of a trajectory, from which each method
    takes its best. ``gradient(q, out)``: numba function that writes dU/dq (n,) into ``out`` and returns
    U. ``observe(q, potential, out)``: numba function that writes the observables of a state.
    ``observables``: names of the observables. ``start(normal)``: a state (n,); one from the target itself if
    ``warm`` is 0. ``warm``: proposals from a start to the first that counts.
    """

    name: str
    label: str
    dimension: int
    highest: float
    lengths: tuple[float, ...]
    gradient: Any
    observe: Any
    observables: tuple[str, ...]
    start: Callable[[Normal], Floats]
    warm: int = 0


# --- The phi^4 field on a square lattice with periodic edges, in its symmetric phase near the transition.
#
# U = sum over sites of (differences to two neighbours)^2/2 + m phi^2/2 + l phi^4/4. For l = 1 the transition is at
# m = -1.2723: W. Loinaz and R. S. Willey, Phys. Rev. D 58, 076003 (1998), doi:10.1103/PhysRevD.58.076003.

#: Coefficients m and l, and proposals from a random start.
MASS, COUPLING, WARM = -1.0, 1.0, 400


def lattice(n: int) -> Target:
    """Return the target on a lattice of at most n sites."""
    edge = int(n**0.5)

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        total = 0.0
        for i in range(edge):
            row, above, below = i * edge, (i - 1 if i else edge - 1) * edge, (i + 1 if i + 1 < edge else 0) * edge
            for j in range(edge):
                right, left = (j + 1 if j + 1 < edge else 0), (j - 1 if j else edge - 1)
                x = q[row + j]
                two = q[row + right] + q[below + j]
                both = two + q[row + left] + q[above + j]
                square = x * x
                out[row + j] = x * (4.0 + MASS + COUPLING * square) - both
                total += square * (2.0 + 0.5 * MASS + 0.25 * COUPLING * square) - x * two
        return total

    @compiled
    def observe(q, potential, out):  # type: ignore[no-untyped-def]
        out[0] = q.sum() / len(q)
        out[1], out[2] = out[0] * out[0], potential

    return Target(
        name="lattice",
        label=rf"$\phi^4$ field, {edge} $\times$ {edge} sites",
        dimension=edge * edge,
        highest=3.0,
        lengths=(1.5, 3.0, 6.0),
        gradient=gradient,
        observe=observe,
        observables=("mean field", "its square", "U"),
        start=lambda normal: 0.5 * normal.rows(1, edge * edge)[0],
        warm=WARM,
    )


# --- Three posteriors of posteriordb, with the published means and squares of their reference draws.
#
# Models, data and summaries: M. Magnusson et al., posteriordb, https://github.com/stan-dev/posteriordb, commit
# 28f8d3d6, licence BSD-3-Clause. Positive parameters are exponentials of coordinates, as in Stan; coordinates are
# shifted and scaled by constants near their posterior means and standard deviations, in place of an adaptation of the
# masses.


#: Proposals from a start near the mean.
POSTERIORS_WARM = 500


class Reference(NamedTuple):
    """Published means of parameters and of their squares, with standard errors, by parameter."""

    mean: dict[str, tuple[float, float]]
    square: dict[str, tuple[float, float]]


REFERENCES = {
    "eight_schools": Reference(
        {"mu": (4.41051833695493, 0.0330374705950917), "tau": (3.60205952364059, 0.0318615135640706)},
        {"mu": (30.40302, 0.3351356), "tau": (23.20407, 0.4848872)},
    ),
    "gp_regr": Reference(
        {
            "rho": (6.87434817782581, 0.0127649184133038), "alpha": (2.4423998398757, 0.00775729060630055),
            "sigma": (1.82873106572797, 0.00502769102294288),
        },
        {"rho": (48.85864, 0.18295535), "alpha": (6.576518, 0.04434399), "sigma": (3.599273, 0.02046443)},
    ),
    "mesquite": Reference(
        {
            "beta[1]": (5.17084758450824, 0.000873165446265347), "beta[2]": (0.722008519434549, 0.000563651945878131),
            "sigma": (0.426670305955934, 0.000480101525987333),
        },
        {"beta[1]": (26.7451327, 0.009058146), "beta[2]": (0.5244543, 0.0008146948), "sigma": (0.184331, 0.0004276198)},
    ),
}  # fmt: skip

#: D. B. Rubin, J. Educ. Stat. 6, 377 (1981), doi:10.3102/10769986006004377: effects of eight schools, their errors.
EFFECTS, ERRORS = np.array([28, 8, -3, 7, -1, 1, 18, 12.0]), np.array([15, 10, 16, 11, 9, 11, 10, 18.0])
#: Simulated data of posteriordb, at -10, -8 and so on to 10.
Y = np.array([4.75906, 1.59423, 2.99548, 5.27501, 1.66472, 2.24347, 2.8914, 4.08681, 4.60588, 0.802364, 3.92136])
#: Mesquite bushes (Gelman & Hill 2006, Ch. 4): diameters, height of the canopy, weight of the leaves.
_LONG = (
    1.8, 1.7, 2.8, 1.3, 3.3, 1.4, 1.5, 3.9, 1.8, 2.1, 0.8, 1.3, 1.2, 1.5, 2.8, 1.4, 1.5, 2.4, 1.9, 2.3, 2.1, 2.4, 1,
    1.3, 1.1, 1.3, 2.5, 5.2, 2, 1.6, 1.4, 3.2, 1.9, 2.4, 2.5, 2.1, 2.4, 2.4, 1.9, 2.7, 1.3, 2.9, 2.1, 4.1, 2.8, 1.27,
)  # fmt: skip
_SHORT = (
    1.15, 1.35, 2.55, 0.85, 1.9, 1.4, 0.5, 2.3, 1.35, 1.6, 0.63, 0.95, 0.9, 0.7, 1.7, 0.85, 0.6, 2.4, 1.55, 1.6, 1.7,
    1.3, 0.4, 0.6, 0.7, 1.2, 2.3, 4, 1.6, 1.6, 1, 1.9, 1.8, 2.4, 1.8, 1.5, 2.2, 1.7, 1.2, 2.5, 1.1, 2.7, 1, 3.8, 2.5, 1,
)  # fmt: skip
_HEIGHT = (
    1, 1.33, 0.6, 1.2, 1.05, 1, 0.9, 1.3, 0.6, 0.8, 0.6, 0.95, 1.2, 0.7, 1.2, 1.1, 0.64, 1.2, 1.2, 1.3, 1, 0.9, 1, 0.5,
    0.9, 0.6, 1.4, 2.5, 1.4, 1.3, 1.1, 1.5, 0.8, 1.1, 1.3, 0.85, 1.5, 1.2, 1.15, 1.5, 0.7, 1.9, 1.5, 1.5, 1.5, 0.62,
)  # fmt: skip
_WEIGHT = (
    401.3, 513.7, 1179.2, 308, 855.2, 268.7, 155.5, 1253.2, 328, 614.6, 60.2, 269.6, 448.4, 120.4, 378.7, 266.4, 138.9,
    1020.8, 635.7, 621.8, 579.8, 326.8, 66.7, 68, 153.1, 256.4, 723, 4052, 345, 330.9, 163.5, 1160, 386.6, 693.5, 674.4,
    217.5, 771.3, 341.7, 125.7, 462.5, 64.5, 850.6, 226, 1745.1, 908, 213.5,
)  # fmt: skip
#: Shifts and scales of the coordinates: mu and log tau; the logarithms of rho, alpha and sigma; beta and log sigma.
COORDINATES = {
    "eight_schools": (np.array([4.4, 0.8]), np.array([3.3, 1.1])),
    "gp_regr": (np.array([log(6.76), log(2.3), log(1.75)]), np.array([0.19, 0.32, 0.29])),
    "mesquite": (np.array([5.17, 0.722, log(0.42)]), np.array([0.083, 0.055, 0.107])),
}


def eight_schools() -> Target:
    """Return the model of eight schools with normalised effects: theta = mu + tau z."""
    (shift, log_shift), (scale, log_scale) = COORDINATES["eight_schools"]

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        mu, logarithm_tau = shift + scale * q[8], log_shift + log_scale * q[9]
        tau = exponential(logarithm_tau)
        total, of_mu, of_tau = mu * mu / 50, mu / 25, 2 * tau * tau / (25 + tau * tau) - 1
        total += logarithm(1 + tau * tau / 25) - logarithm_tau
        for k in range(8):
            pull = (q[k] * tau + mu - EFFECTS[k]) / ERRORS[k]
            total += (pull * pull + q[k] * q[k]) / 2
            out[k] = q[k] + pull * tau / ERRORS[k]
            of_mu += pull / ERRORS[k]
            of_tau += pull * q[k] * tau / ERRORS[k]
        out[8], out[9] = of_mu * scale, of_tau * log_scale
        return total

    @compiled
    def observe(q, potential, out):  # type: ignore[no-untyped-def]
        out[0], out[1] = shift + scale * q[8], exponential(log_shift + log_scale * q[9])
        out[2], out[3] = out[0] * out[0], out[1] * out[1]

    return _posterior("eight_schools", "eight schools, 10 parameters", 10, gradient, observe, highest=2.0)


def gp_regr() -> Target:
    """Return the regression of eleven points by a Gaussian process with length rho, size alpha and variance sigma."""
    shift, scale = COORDINATES["gp_regr"]

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        n = len(Y)
        rho, alpha, sigma = (
            exponential(shift[0] + scale[0] * q[0]), exponential(shift[1] + scale[1] * q[1]),
            exponential(shift[2] + scale[2] * q[2]),
        )  # fmt: skip
        kernel, inverse = np.empty(n), np.zeros((n, n))
        for k in range(n):
            kernel[k] = alpha * alpha * exponential(-2.0 * k * k / (rho * rho))
        left = np.zeros((n, n))
        pivots = 1.0
        for i in range(n):  # Gauss-Jordan of a positive matrix needs no exchanges
            inverse[i, i] = 1.0
            for j in range(n):
                left[i, j] = kernel[abs(i - j)] + (sigma if i == j else 0.0)
        for i in range(n):
            pivot = left[i, i]
            pivots *= pivot
            for j in range(n):
                left[i, j], inverse[i, j] = left[i, j] / pivot, inverse[i, j] / pivot
            for k in range(n):
                if k != i:
                    factor = left[k, i]
                    for j in range(n):
                        left[k, j] -= factor * left[i, j]
                        inverse[k, j] -= factor * inverse[i, j]
        total, of_rho, of_alpha, of_sigma = logarithm(pivots) / 2, 0.0, 0.0, 0.0
        weights = np.zeros(n)
        for i in range(n):
            for j in range(n):
                weights[i] += inverse[i, j] * Y[j]
        for i in range(n):
            total += weights[i] * Y[i] / 2
            of_sigma += (inverse[i, i] - weights[i] * weights[i]) / 2 * sigma
            for j in range(n):
                part = (inverse[i, j] - weights[i] * weights[j]) / 2 * kernel[abs(i - j)]
                of_alpha += 2 * part
                of_rho += part * 4.0 * (i - j) * (i - j) / (rho * rho)
        # Priors gamma(25, 4), normal(0, 2) and normal(0, 1) on positive numbers, and the logarithms as coordinates.
        total += 4 * rho - 25 * (shift[0] + scale[0] * q[0]) + alpha * alpha / 8 - (shift[1] + scale[1] * q[1])
        total += sigma * sigma / 2 - (shift[2] + scale[2] * q[2])
        out[0] = scale[0] * (of_rho + 4 * rho - 25)
        out[1] = scale[1] * (of_alpha + alpha * alpha / 4 - 1)
        out[2] = scale[2] * (of_sigma + sigma * sigma - 1)
        return total

    @compiled
    def observe(q, potential, out):  # type: ignore[no-untyped-def]
        for k in range(3):
            out[k] = exponential(shift[k] + scale[k] * q[k])
            out[3 + k] = out[k] * out[k]

    return _posterior("gp_regr", "Gaussian process, 3 parameters", 3, gradient, observe)


def mesquite_logarithms() -> tuple[Floats, Floats]:
    """Return the logarithms of the volumes of the canopies and of the weights of the leaves."""
    return log(np.array(_LONG) * np.array(_SHORT) * np.array(_HEIGHT)), log(np.array(_WEIGHT))


def mesquite() -> Target:
    """Return the regression of log weight of leaves on log volume of the canopy."""
    volume, weight = mesquite_logarithms()
    shift, scale = COORDINATES["mesquite"]

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        first, second = shift[0] + scale[0] * q[0], shift[1] + scale[1] * q[1]
        logarithm_sigma = shift[2] + scale[2] * q[2]
        precision = exponential(-2.0 * logarithm_sigma)
        squares, of_first, of_second = 0.0, 0.0, 0.0
        for k in range(len(volume)):
            rest = first + second * volume[k] - weight[k]
            squares += rest * rest
            of_first += rest
            of_second += rest * volume[k]
        out[0], out[1] = scale[0] * precision * of_first, scale[1] * precision * of_second
        out[2] = scale[2] * (len(volume) - 1 - precision * squares)
        return precision * squares / 2 + (len(volume) - 1) * logarithm_sigma

    @compiled
    def observe(q, potential, out):  # type: ignore[no-untyped-def]
        for k in range(2):
            out[k] = shift[k] + scale[k] * q[k]
        out[2] = exponential(shift[2] + scale[2] * q[2])
        for k in range(3):
            out[3 + k] = out[k] * out[k]

    return _posterior("mesquite", "regression, 3 parameters", 3, gradient, observe)


def _posterior(name: str, label: str, n: int, gradient: Any, observe: Any, highest: float = 1.0) -> Target:
    parameters = list(REFERENCES[name].mean)

    return Target(
        name=name, label=label, dimension=n, highest=highest, lengths=(1.0, 2.0, 4.0), gradient=gradient,
        observe=observe, observables=(*parameters, *(f"{one}^2" for one in parameters)),
        start=lambda normal: 0.3 * normal.rows(1, n)[0], warm=POSTERIORS_WARM,
    )  # fmt: skip


POSTERIORS: dict[str, Callable[[], Target]] = {
    "eight_schools": eight_schools, "gp_regr": gp_regr, "mesquite": mesquite,
}  # fmt: skip


# --- A product of quartic oscillators with frequencies over a decade: U = sum x^2/2 + b x^4/4 with x = omega q.

#: Strength b of the quartic term; the ratio of the frequencies; modes that the slowest observables see.
STRENGTH, RATIO, SLOW = 1.0, 10.0, 10
#: Places of the density of x, which is below exp(-20) of its maximum at the ends for b >= 0 and REACH^2 / 2 = 20.
PLACES, REACH = 4001, 6.4


def quantiles(strength: float, probabilities: Floats, temperature: float = 1.0) -> Floats:
    """Return the quantiles of the density exp(-(x^2/2 + b x^4/4)/temperature), by the trapezoidal rule."""
    x = np.linspace(-REACH, REACH, PLACES) * np.sqrt(temperature)
    density = exp(-(x**2 / 2 + strength * x**4 / 4) / temperature)
    sums = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    found: Floats = np.interp(probabilities * sums[-1], sums, x)
    return found


def frequencies_of(n: int) -> Floats:
    """Return n frequencies, log-uniform from 1/RATIO to 1, ascending."""
    found: Floats = exp(-log(RATIO) * (1 - (np.arange(n) + 0.5) / n))
    return found


def quartic(n: int, strength: float = STRENGTH) -> Target:
    """Return the target in n dimensions."""
    frequencies = frequencies_of(n)
    squares = frequencies**2

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        total = 0.0
        for k in range(len(q)):
            square = squares[k] * q[k] * q[k]
            out[k] = squares[k] * q[k] * (1.0 + strength * square)
            total += square * (2.0 + strength * square)
        return total / 4

    @compiled
    def observe(q, potential, out):  # type: ignore[no-untyped-def]
        out[0], out[1], out[2] = q[0], 0.0, potential
        for k in range(min(SLOW, len(q))):
            out[1] += q[k] * q[k]

    return Target(
        name="quartic",
        label=f"quartic posterior, {n} dimensions",
        dimension=n,
        highest=1.0,
        lengths=(4.0, 8.0, 16.0),
        gradient=gradient,
        observe=observe,
        observables=("slowest coordinate", "squares of the slowest", "U"),
        start=lambda normal: quantiles(strength, normal.uniform.random(n)) / frequencies,
    )


# --- Effective samples of several chains by Geyer's initial monotone sequence, and intervals over the chains.
#
# C. J. Geyer, Statist. Sci. 7, 473 (1992), doi:10.1214/ss/1177011137.

#: Autocovariances are formed up to this lag at most, and up to a quarter of a chain; the number that is tried first.
LAGS, FIRST = 400, 32
#: Student's t for a probability of 0.975, by degrees of freedom: Abramowitz & Stegun (1964), Table 26.10.
STUDENT = {1: 12.706, 2: 4.303, 3: 3.182, 5: 2.571, 7: 2.365, 11: 2.201, 15: 2.131, 23: 2.069, 31: 2.040}


def covariances(chains: Floats, lags: int = LAGS) -> Floats:
    """Return the autocovariances (chains, lags) of chains (chains, c) around their common mean, up to c/4."""
    y = chains - chains.mean()
    c = y.shape[1]
    return np.array([[(row[: c - lag] * row[lag:]).sum() / c for lag in range(min(c // 4, lags))] for row in y])


def enough(chains: Floats) -> Floats:
    """Return autocovariances up to LAGS, or fewer if the sums of :func:`time_of` end before, without any one chain."""
    lags, most = FIRST, min(LAGS, chains.shape[1] // 4)
    while True:
        found = covariances(chains, min(lags, most))
        if lags >= most or all(_ends(np.delete(found, k, axis=0).mean(axis=0)) for k in range(len(found))):
            return found
        lags *= 4


def _pairs(covariance: Floats) -> Floats:
    found: Floats = covariance[: len(covariance) // 2 * 2].reshape(-1, 2).sum(axis=1)
    return found


def _ends(covariance: Floats) -> bool:
    return not covariance[0] > 0 or bool((_pairs(covariance) <= 0).any())


def time_of(covariance: Floats) -> float:
    """Return the integrated autocorrelation time, 1 + 2 sum of autocorrelations, of autocovariances (lags,).

    Pairs of neighbouring lags are summed up to the first that is not positive, none above the one before.
    """
    if not covariance[0] > 0:
        return np.inf
    pairs = _pairs(covariance) / covariance[0]
    positive = np.flatnonzero(pairs <= 0)
    kept = np.minimum.accumulate(pairs[: positive[0] if positive.size else len(pairs)])
    return float(max(2 * kept.sum() - 1, 1e-3))


def costs(chains: Floats, gradients: Floats) -> Floats:
    """Return log(gradients per effective sample of the slowest observable), of all chains and without each of them.

    ``chains`` (chains, c, observables): observables of each proposal. ``gradients`` (chains,): gradients of each chain.
    :func:`error_of` has the standard error from the result (chains + 1,).
    """
    of_each = [enough(chains[..., k]) for k in range(chains.shape[-1])]
    every = np.arange(len(chains))

    def cost(kept: np.ndarray) -> float:
        time = max(time_of(one[kept].mean(axis=0)) for one in of_each)
        return float(log(gradients[kept].mean() / chains.shape[1] * time))

    return np.array([cost(every >= 0), *(cost(every != k) for k in every)])


def error_of(values: Floats) -> float:
    """Return the standard error of a value of :func:`costs`, or of a difference of two: the jackknife over chains."""
    parts = values[1:]
    return float(np.sqrt((len(parts) - 1) * ((parts - parts.mean()) ** 2).mean()))


def student(degrees: int) -> float:
    """Return Student's t at a probability of 0.975, for at least this number of degrees of freedom in a table."""
    return STUDENT[max(one for one in STUDENT if one <= degrees)]


# --- Chains of Hamiltonian Monte Carlo with one method, compiled for each target.
#
# The force at the end of a trajectory serves the next first kick: a trajectory of N steps of s stages takes N s
# gradients. A method that begins with a drift evaluates U once more, without its gradient.

#: Times of a trajectory are uniform in this range around the chosen one, so that no mode returns to its start.
JITTER = (0.8, 1.2)
#: Leapfrog, with which chains warm up and which searches refer to, in configs without it too.
LEAPFROG = Tableau(
    name="leapfrog", order=2, first="kick", kick=("0.5", "0.5"), drift=("1",), source="Verlet (1967)", digits=14
)


class Chance(NamedTuple):
    """Random numbers of a chain, equal for all methods: momenta (c, n), logarithms and lengths (c,)."""

    momenta: Floats
    logarithms: Floats
    lengths: Floats


def chance(normal: Normal, count: int, n: int) -> Chance:
    """Draw the random numbers of ``count`` proposals."""
    low, high = JITTER
    momenta, accept, length = normal.rows(count, n), normal.uniform.random(count), normal.uniform.random(count)
    return Chance(momenta, -log(1.0 - accept), low + (high - low) * length)


class Chain(NamedTuple):
    """A chain: observables (c, o), energy errors of its proposals (c,), gradients, and the last state (n,)."""

    observed: Floats
    changes: Floats
    gradients: int
    last: Floats

    def acceptance(self) -> float:
        """Return the mean of min(1, exp(-dH)) over the proposals."""
        changes = np.where(np.isfinite(self.changes), np.clip(self.changes, 0.0, 700.0), 700.0)
        return float(exp(-changes).mean())


@compiled
def _kinetic(p):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(len(p)):
        total += p[k] * p[k]
    return total / 2


@compiled
def _add(x, time, y):  # type: ignore[no-untyped-def]
    for k in range(len(x)):
        x[k] += time * y[k]


def loop_for(target: Target) -> Callable[..., None]:
    """Compile the chain for a target.

    The result is ``loop(q, momenta, logarithms, counts, kicks_first, outer, inner, observed, changes)``: a proposal for
    each row of the momenta, from q, which holds the last state at the end.
    """
    gradient, observe = target.gradient, target.observe

    @compiled
    def loop(q, momenta, logarithms, counts, kicks_first, outer, inner, observed, changes):  # type: ignore[no-untyped-def]
        slopes, found, trial, p = np.empty(len(q)), np.empty(len(q)), np.empty(len(q)), np.empty(len(q))
        potential = gradient(q, slopes)
        for t in range(len(momenta)):
            p[:], trial[:], found[:] = momenta[t], q, slopes
            before, proposed = _kinetic(p) + potential, potential
            for _ in range(counts[t]):
                for m in range(len(inner)):
                    if kicks_first:
                        _add(p, -outer[m], found)
                        _add(trial, inner[m], p)
                        proposed = gradient(trial, found)
                    else:
                        _add(trial, outer[m], p)
                        gradient(trial, found)
                        _add(p, -inner[m], found)
                if kicks_first:
                    _add(p, -outer[-1], found)
                else:
                    _add(trial, outer[-1], p)
            if not kicks_first:
                proposed = gradient(trial, found)
            changes[t] = (_kinetic(p) - before) + proposed
            if changes[t] <= logarithms[t]:
                q[:], slopes[:] = trial, found
                potential = proposed
            observe(q, potential, observed[t])

    return loop  # type: ignore[no-any-return]


def run(
    target: Target, loop: Callable[..., None], method: Tableau, tau: float, length: float, start: Floats, drawn: Chance
) -> Chain:
    """Return a chain from a start, with steps ``tau`` and trajectories of about ``length``."""
    counts = np.maximum(1, np.rint(length * drawn.lengths / tau)).astype(np.int64)
    outer, inner = (tau * np.array(row) for row in method.rows_double())
    observed, changes = np.empty((len(counts), len(target.observables))), np.empty(len(counts))
    q = start.copy()
    loop(
        q, drawn.momenta, drawn.logarithms, counts, method.first == "kick", outer, inner, observed, changes
    )  # fmt: skip
    return Chain(observed, changes, int(counts.sum()) * method.stages, q)


# --- Acceptance and squared jumps on Gaussians, exactly, without chains.
#
# In units of standard deviations a trajectory multiplies (q, p) of each mode by a matrix [[c, x s], [-s/x, c]] with
# c^2 + s^2 = 1. Its energy error is a form of two normal numbers, whose characteristic function at u + i/2 is
# (1 + g (u^2 + 1/4))^(-1/2) with g = (x - 1/x)^2 s^2. With u = tan(a)/2 the mean of min(1, exp(-dH)) over independent
# modes is (2/pi) times the integral over a from 0 to pi/2 of the product of (1 + g/(4 cos^2 a))^(-1/2); the mean
# squared jump has the same form.

#: Nodes of the integral over a: the midpoint rule, whose integrand is smooth and periodic.
NODES = 48
#: Modes of different frequency; a Gaussian of more dimensions has several of each. Lengths of the jitter.
FREQUENCIES, JITTER_LENGTHS = 100, 9


class Spectrum(NamedTuple):
    """Frequencies (k,) of a Gaussian, ascending, and the number of modes with each."""

    frequencies: Floats
    modes: float


def spectrum(dimension: int) -> Spectrum:
    """Return the frequencies of the quartic target, at most :data:`FREQUENCIES` of them."""
    count = min(FREQUENCIES, dimension)
    return Spectrum(frequencies_of(count), dimension / count)


def steps_matrix(method: Tableau, angles: Floats) -> Floats:
    """Return the matrices (k, 2, 2) of a step of oscillators whose frequency times step size is ``angles`` (k,)."""
    outer, inner = method.rows_double()
    found = np.tile(np.eye(2), (len(angles), 1, 1))
    for i in range(len(outer) + len(inner)):
        move = (outer, inner)[i % 2][i // 2] * angles
        if (i % 2 == 0) == (method.first == "kick"):
            found[:, 1] -= move[:, None] * found[:, 0]
        else:
            found[:, 0] += move[:, None] * found[:, 1]
    return found


def power(matrices: Floats, count: int) -> Floats:
    """Return powers of matrices (k, 2, 2), by squaring."""
    found, square = np.tile(np.eye(2), (len(matrices), 1, 1)), matrices
    with np.errstate(all="ignore"):  # unstable steps
        while count:
            if count % 2:
                found = _product(found, square)
            square, count = _product(square, square), count // 2
    return found


def _product(a: Floats, b: Floats) -> Floats:
    found: Floats = a[:, :, :1] * b[:, :1, :] + a[:, :, 1:] * b[:, 1:, :]
    return found


def moments(matrices: Floats, modes: float) -> tuple[float, Floats]:
    """Return the acceptance, and the mean squared jump (k,) of each mode over twice its variance.

    ``matrices`` (k, 2, 2): matrices of a trajectory. ``modes``: number of modes with each matrix.
    """
    if not np.isfinite(matrices).all() or np.abs(matrices).max() > 1e6:
        return 0.0, np.zeros(len(matrices))
    g = np.maximum((matrices**2).sum(axis=(1, 2)) - 2, 0)  # det = 1: |M|^2 = 2 + g
    jump = (matrices[:, 0, 0] - 1) ** 2 + matrices[:, 0, 1] ** 2
    squares = cos((np.arange(NODES) + 0.5) * np.pi / 2 / NODES) ** 2
    ratios = g[:, None] / (4 * squares)
    weights = exp(-0.5 * modes * log(1 + ratios).sum(axis=0)) / NODES
    return float(weights.sum()), jump / 2 * (weights / (1 + ratios)).sum(axis=1)


def efficiency(method: Tableau, tau: float, length: float, on: Spectrum) -> tuple[float, float]:
    """Return gradients over the least mean squared jump, in 2 variances, and the acceptance, at about a ``length``."""
    low, high = JITTER
    times = length * (low + (high - low) * (np.arange(JITTER_LENGTHS) + 0.5) / JITTER_LENGTHS)
    counts = [max(1, round(time / tau)) for time in times]
    step = steps_matrix(method, tau * on.frequencies)
    acceptance, jumps = 0.0, np.zeros(len(on.frequencies))
    for count in sorted(set(counts)):
        share = counts.count(count) / JITTER_LENGTHS
        one, squared = moments(power(step, count), on.modes)
        acceptance, jumps = acceptance + share * one, jumps + share * squared
    least = float(jumps.min())
    gradients = sum(counts) / JITTER_LENGTHS * method.stages
    return gradients / least if least > 0 else np.inf, acceptance
