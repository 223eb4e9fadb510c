"""Problems of trained methods: random potentials, rings, orbits and named systems, and their anharmonicity."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import combinations, combinations_with_replacement, pairwise
from math import prod
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import parameter_array, standard_parameters
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.yoshida_1990 import TABLEAUS
from nearharmonic.math import cos, exp, log, sin
from nearharmonic.numerics.portable import Floats, eigen, product
from nearharmonic.systems import henon_heiles, kepler
from nearharmonic.systems.quantities import Parameter, Vector
from nearharmonic.systems.system import System
from nearharmonic.training.objective import Ensemble

# --- Anharmonicity of orbits: the variation of the Hessian of V along them.
#
# delta = rms |W - mean W| / rms |W| along the orbit, W = V'' and |.| the Frobenius norm, for masses of 1. It is 0 for
# every harmonic system, for all frequencies and amplitudes, and at most 1.

#: Time between the states at which the Hessian is evaluated, in units of the ensemble, and minimum number of states. It
#: is no simple fraction of a period, to avoid aliasing.
BETWEEN, FEWEST = 0.77, 65
#: Number of steps between these states.
STEPS = 2


def with_anharmonicity(ensemble: Ensemble) -> Ensemble:
    """Return the ensemble with the anharmonicities of its problems as ``strength``."""
    return replace(ensemble, strength=anharmonicities(ensemble))


def anharmonicities(ensemble: Ensemble) -> Floats:
    """Return delta (M,) of each problem, over its interval."""
    samples = max(FEWEST, round(ensemble.t_end / ensemble.unit / BETWEEN))
    steps = STEPS * (samples - 1)
    paths = integrate_batch(
        ensemble.system, TABLEAUS[0], t_end=Fraction(ensemble.t_end), steps=np.full(ensemble.size, steps),
        samples=samples, numerics=Numerics(summation="plain", energy="samples"), start=ensemble.start,
        parameters=ensemble.parameters,
    )  # fmt: skip
    W = hessians(ensemble.system, paths.q, ensemble.parameters[:, None, ::2])
    mean = np.nanmean(W, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        found: Floats = np.sqrt(np.nansum((W - mean) ** 2, axis=(1, 2, 3)) / np.nansum(W**2, axis=(1, 2, 3)))
    return found


def hessians(system: System, q: Floats, parameters: Floats | None = None) -> Floats:
    """Return V'' (..., d, d) at positions (..., d), for parameters (..., P) or the system's own."""
    d = q.shape[-1]
    given = system.constants(float) if parameters is None else tuple(np.moveaxis(parameters, -1, 0))
    shape = q.shape[:-1]
    columns = [
        system.hessian_V_times(tuple(np.moveaxis(q, -1, 0)), tuple(map(float, unit)), *given) for unit in np.eye(d)
    ]
    rows = [np.stack([np.broadcast_to(x, shape) for x in column], axis=-1) for column in columns]
    return np.stack(rows, axis=-1)


def _log_uniform(random: np.random.Generator, bounds: tuple[float, float], shape: int | tuple[int, ...]) -> Floats:
    low, high = map(log, bounds)
    return np.asarray(exp(random.uniform(low, high, shape)))


def _drawn(name: str, label: str, V: Callable[..., Any], dimension: int, parameters: list[str]) -> System:
    """Return a system whose parameters and starts are drawn for each problem; its own are placeholders."""
    point = ("0.25",) * dimension
    return System(
        name=name, label=label, V=V, q0=point, p0=point, t_end="100",
        parameters=dict.fromkeys(parameters, Parameter(value="0.125")),
        source="drawn at random: nearharmonic_studies.trained.problems",
    )  # fmt: skip


# --- Near-harmonic systems with cubic potentials, drawn at random.
#
#     V = sum_i w_i^2 q_i^2 / 2 + sum_(i <= j <= k) c_ijk q_i q_j q_k
#
# One frequency is 1, the others are uniform in [0.6, 1]. Along a direction n the potential falls beyond a barrier of
# the height w(n)^6 / (54 c(n)^2), with w(n)^2 = sum w_i^2 n_i^2 and c(n) the cubic form. The coefficients are normal,
# scaled so that the energy of the start is a fraction of the lowest barrier, log-uniform in a band: no orbit escapes.
# For the system of Henon & Heiles (1964), doi:10.1086/109234, the barrier is 1/6. The amplitude is 1, its square
# distributed over the coordinates uniformly on the simplex; phases are uniform.

#: Bounds of the slower frequencies.
CUBIC_FREQUENCIES = (0.6, 1.0)
#: Directions in which the barrier is sought.
DIRECTIONS = 400


def _monomials(dimension: int) -> list[tuple[int, ...]]:
    return list(combinations_with_replacement(range(dimension), 3))


@cache
def cubic_potential(dimension: int) -> System:
    """Return the system whose parameters are squares of frequencies, and cubic coefficients."""
    terms = _monomials(dimension)
    names = [f"a{i}" for i in range(dimension)] + ["c" + "".join(map(str, term)) for term in terms]

    def V(q: Any, *coefficients: Any) -> Any:
        squares, cubic = coefficients[:dimension], coefficients[dimension:]
        total = sum(a * x * x for a, x in zip(squares, q, strict=True)) / 2
        return total + sum(c * prod(q[i] for i in term) for c, term in zip(cubic, terms, strict=True))

    return _drawn(f"cubic_potential_{dimension}", f"cubic potential, d = {dimension}", V, dimension, names)


def cubic_ensemble(dimension: int, count: int, seed: int, *, band: tuple[float, float], t_end: float) -> Ensemble:
    """Return ``count`` random systems of 2 or 3 coordinates with their starts.

    ``band`` are the bounds of the energy over the lowest barrier, and ``t_end`` the length of every run, in radians of
    the frequency 1.
    """
    system, random = cubic_potential(dimension), np.random.default_rng([seed, dimension, count, 3])
    terms = np.array(_monomials(dimension))
    start = np.zeros((count, 4, dimension))
    parameters = np.zeros((count, len(system.parameters), 2))
    fraction = _log_uniform(random, band, count)
    for i, part in enumerate(fraction):
        w: Floats = random.uniform(*CUBIC_FREQUENCIES, dimension)
        w[random.integers(dimension)] = 1.0
        n: Floats = random.normal(size=(DIRECTIONS, dimension))
        cubic: Floats = random.normal(size=len(terms))
        amplitude = np.sqrt(random.dirichlet(np.ones(dimension)))
        phase = random.uniform(0.0, 2 * np.pi, dimension)
        q, p = amplitude * cos(phase) / w, amplitude * sin(phase)
        scale = _scale(n, w * w, terms, cubic, q, part)
        parameters[i, :, 0] = np.concatenate([w**2, scale * cubic])
        start[i, 0], start[i, 2] = q, p
    return Ensemble(
        name=f"d = {dimension}, {band[0]:g} to {band[1]:g}", system=system, start=start.reshape(count, -1),
        parameters=parameters.reshape(count, -1), t_end=t_end, strength=fraction,
    )  # fmt: skip


def _scale(n: Floats, squares: Floats, terms: Any, cubic: Floats, q: Floats, fraction: float) -> float:
    """The factor of the cubic coefficients with which 1/2 + |cubic energy| at the start is ``fraction`` of the barrier.

    The harmonic energy of every start is 1/2.
    """
    along = product(n[:, terms].prod(axis=-1), cubic[:, None])[:, 0]
    lowest = float((product(n * n, squares[:, None])[:, 0] ** 3 / (54 * along**2)).min())
    own = abs(float((cubic * q[terms].prod(axis=-1)).sum()))
    # (1/2 + own s) s^2 = fraction * lowest; Newton's method from above, where the function is convex.
    s: float = (2 * fraction * lowest) ** 0.5
    for _ in range(30):
        s -= ((0.5 + own * s) * s * s - fraction * lowest) / (s + 3 * own * s * s)
    return s


# --- Named systems, with starts at given energies; no method is trained on them.
#
# All have T = p.p/2 and rest at q = 0, where V is 0. The energy of a start is log-uniform in a given range. Its
# direction is uniform on the energy surface of the small oscillations, and its length is the first at which H along
# this direction reaches the energy. Directions of frequency 0, such as the translation of the Toda ring, are omitted:
# the total momentum is 0.

#: Sites of the chains of Fermi, Pasta, Ulam and Tsingou, of Toda's ring, and atoms of the chain of Lennard-Jones.
CHAIN_SITES, RING, ATOMS = 8, 6, 5
#: Coefficients of the cubic and of the quartic chain, and of the quartic well.
ALPHA, BETA, WELL = 0.25, 1.0, 0.25
#: Ratio of successive lengths in the search along a direction, and number of bisections.
SHORTEST, LENGTH_RATIO, BISECTIONS = 1e-3, 1.02, 60
#: Limit of squared frequencies, below which a direction counts as free.
FREE = 1e-9


def pendulum(q: Vector) -> Any:
    """V = 1 - cos q."""
    return 1 - cos(q[0])


def morse(q: Vector) -> Any:
    """V = (1 - exp(-q))^2: the depth is 1, and so is the width."""
    x = 1 - exp(-q[0])
    return x * x


def quartic_well(q: Vector) -> Any:
    """V = q.q/2 + b (q.q)^2 in the plane."""
    square = q[0] * q[0] + q[1] * q[1]
    return square / 2 + WELL * (square * square)


def toda_ring(q: Vector) -> Any:
    """V = sum of exp(d) - d - 1 over the differences d of neighbours in a ring; the sum of d is 0."""
    return sum(exp(a - b) - 1 for a, b in pairwise((*q, q[0])))


def fput_alpha(q: Vector) -> Any:
    """V = sum of d^2/2 + alpha d^3/3 over the springs of a chain between fixed ends."""
    return sum(d * d * (0.5 + ALPHA / 3 * d) for d in _springs(q))


def fput_beta(q: Vector) -> Any:
    """V = sum of d^2/2 + beta d^4/4 over the springs of a chain between fixed ends."""
    return sum(d * d * (0.5 + BETA / 4 * (d * d)) for d in _springs(q))


def lennard_jones(q: Vector) -> Any:
    """V = sum of (r^-12 - 2 r^-6 + 1)/72 over neighbours at r = 1 + d between fixed ends: each bond has V'' = 1."""
    return sum(_lennard_jones_bond(1 + d) for d in _springs(q))


def _springs(q: Vector) -> list[Any]:
    return [b - a for a, b in zip((0, *q), (*q, 0), strict=True)]


def _lennard_jones_bond(r: Any) -> Any:
    square = 1 / (r * r)
    x = 1 - square * square * square
    return x * x / 72


@dataclass(frozen=True)
class Named:
    """A potential of ``dimension`` coordinates, and the range of the energies of its starts."""

    name: str
    label: str
    V: Callable[..., Any]
    dimension: int
    energies: tuple[float, float]
    source: str

    def system(self) -> System:
        """Return the system."""
        if self.V is henon_heiles.V:
            return henon_heiles.SYSTEM
        rest = ("0",) * self.dimension
        return System(
            name=f"{self.name}_trained", label=self.label, V=self.V, q0=("0.125", *rest[1:]), p0=rest, t_end="100",
            source=self.source,
        )  # fmt: skip


_MORSE, _HENON = "Morse (1929), Phys. Rev. 34, 57, doi:10.1103/PhysRev.34.57", henon_heiles.SYSTEM.source
_TODA = "Flaschka (1974), Phys. Rev. B 9, 1924, doi:10.1103/PhysRevB.9.1924"
_FPUT = "Fermi, Pasta, Ulam & Tsingou (1955), Los Alamos report LA-1940"
#: Named systems in the order of tables and figures.
NAMED = (
    Named("pendulum", "pendulum", pendulum, 1, (0.005, 0.5), "textbook"),
    Named("morse", "Morse", morse, 1, (0.002, 0.3), _MORSE),
    Named("quartic_well", "quartic well", quartic_well, 2, (0.005, 0.5), "textbook"),
    Named("henon_heiles", "Hénon-Heiles", henon_heiles.V, 2, (1 / 600, 1 / 8), _HENON),
    Named("toda", "Toda ring", toda_ring, RING, (0.03, 1.0), _TODA),
    Named("lennard_jones", "Lennard-Jones chain", lennard_jones, ATOMS, (5e-5, 2e-3), "textbook"),
    Named("fput_alpha", "FPUT-α", fput_alpha, CHAIN_SITES, (1e-3, 0.1), _FPUT),
    Named("fput_beta", "FPUT-β", fput_beta, CHAIN_SITES, (0.05, 1.0), _FPUT),
)


def named_ensembles(count: int, seed: int, t_end: float) -> Iterator[Ensemble]:
    """Yield ``count`` starts of each system, with their anharmonicities.

    ``t_end`` is the length of every run, in radians of the fastest small oscillation.
    """
    for place, one in enumerate(NAMED):
        yield with_anharmonicity(named_ensemble(one, count, [seed, place], t_end))


def named_ensemble(one: Named, count: int, seed: int | list[int], t_end: float) -> Ensemble:
    """Return ``count`` starts of one system; parameters as for :func:`named_ensembles`."""
    system, d = one.system(), one.dimension
    squares, modes = eigen(hessians(system, np.zeros((1, d)))[0])
    random = np.random.default_rng(seed)
    energies = _log_uniform(random, one.energies, count)
    bound = modes[:, squares >= FREE].T
    # The distribution on the sphere is isotropic, so that any basis can be used; here the coordinates.
    sphere = product(random.normal(size=(count, 2, d)), product(bound.T, bound))
    sphere /= np.sqrt((sphere**2).sum(axis=(1, 2), keepdims=True))
    q = product(sphere[:, 0], product(bound.T / np.sqrt(squares[squares >= FREE]), bound))
    p = sphere[:, 1]
    length = _lengths(system, q, p, energies)[:, None]
    start = np.zeros((count, 4, d))
    start[:, 0], start[:, 2] = q * length, p * length
    unit = 1 / float(np.sqrt(squares[-1]))
    return Ensemble(
        name=one.label, system=system, start=start.reshape(count, -1), parameters=standard_parameters(system)[None, :],
        t_end=t_end * unit, unit=unit,
    )  # fmt: skip


def _lengths(system: System, q: Floats, p: Floats, energies: Floats) -> Floats:
    """Return the smallest r (count,) with H(r q, r p) = E."""

    def short(r: Floats) -> Any:
        return system.energy(tuple(r * x for x in q.T), tuple(r * x for x in p.T)) < energies

    low = SHORTEST * np.sqrt(2 * energies)
    while (go_on := short(low * LENGTH_RATIO)).any():
        low = np.where(go_on, low * LENGTH_RATIO, low)
    high = low * LENGTH_RATIO
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        inside = short(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


# --- Kepler orbits of random eccentricity, in the plane, of semi-major axis 1 and period 2 pi.

#: Number of Newton steps that solve Kepler's equation to double precision from E = M, for e below 0.9.
ITERATIONS = 12


def orbit_ensemble(count: int, seed: int, *, eccentricities: tuple[float, float], orbits: float) -> Ensemble:
    """Return ``count`` orbits that start anywhere on their ellipses, over ``orbits`` periods.

    The eccentricity is uniform between the bounds ``eccentricities``.
    """
    random = np.random.default_rng([seed, count])
    e = random.uniform(*eccentricities, count)
    M, turn = random.uniform(0.0, 2 * np.pi, (2, count))
    E = M.copy()
    for _ in range(ITERATIONS):
        E -= (E - e * sin(E) - M) / (1 - e * cos(E))
    b, rate = np.sqrt(1 - e * e), 1 / (1 - e * cos(E))
    q, p = (cos(E) - e, b * sin(E)), (-sin(E) * rate, b * cos(E) * rate)
    cosine, sine = cos(turn), sin(turn)
    start = np.zeros((count, 4, 2))
    for row, (x, y) in ((0, q), (2, p)):
        start[:, row] = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return Ensemble(
        name=f"Kepler, e {eccentricities[0]:g} to {eccentricities[1]:g}", system=kepler.SYSTEM,
        start=start.reshape(count, -1), parameters=parameter_array(kepler.SYSTEM, {"GM": 1}),
        t_end=2 * np.pi * orbits, strength=e,
    )  # fmt: skip


# --- Near-harmonic systems drawn at random: potentials to degree four in two or three coordinates.
#
#     V = sum_i q_i^2 (w_i^2 / 2 + sum_j c_ij q_j + sum_(j >= i) e_ij q_j^2) + sum_(i < j < k) c_ijk q_i q_j q_k
#
# One frequency is 1, the others are uniform in [0.2, 1]. The strength s is log-uniform in a band; every cubic
# coefficient is normal with the deviation 0.4 s, every quartic one 0.1 s plus the modulus of such a number. All
# quartic coefficients are positive, so that H is bounded from below for every draw. The amplitude is uniform in [0.4,
# 1]; its square is distributed over the coordinates uniformly on the simplex; phases are uniform. A momentum is an
# amplitude times a sine. A coordinate is an amplitude times a cosine, divided by the frequency or 0.5, whichever is
# larger.

#: Bounds of the slower frequencies, and of amplitudes.
FREQUENCIES, AMPLITUDES = (0.2, 1.0), (0.4, 1.0)
#: Standard deviations of coefficients over the strength, and smallest quartic coefficient.
DEVIATION, LEAST = 0.4, 0.1
#: Frequency below which the amplitude of a coordinate does not increase, because its potential is soft.
SOFTEST = 0.5


@cache
def random_potential(dimension: int) -> System:
    """Return the system whose parameters are frequencies and coefficients; each run has its own parameters."""
    pairs = [(i, j) for i in range(dimension) for j in range(i, dimension)]
    triples = list(combinations(range(dimension), 3))
    names = [f"a{i}" for i in range(dimension)]
    names += [f"c{i}{j}" for i in range(dimension) for j in range(dimension)]
    names += [f"e{i}{j}" for i, j in pairs] + ["c" + "".join(map(str, triple)) for triple in triples]

    def V(q: Any, *coefficients: Any) -> Any:
        of = dict(zip(names, coefficients, strict=True))
        squares = [x * x for x in q]
        total = 0
        for i in range(dimension):
            cubic = sum(of[f"c{i}{j}"] * q[j] for j in range(dimension))
            quartic = sum(of[f"e{i}{j}"] * squares[j] for j in range(i, dimension))
            total += squares[i] * (of[f"a{i}"] / 2 + cubic + quartic)
        return total + sum(of["c" + "".join(map(str, t))] * prod(q[i] for i in t) for t in triples)

    return _drawn(f"random_potential_{dimension}", f"random potential, d = {dimension}", V, dimension, names)


@cache
def declared_potential(dimension: int) -> System:
    """Return the same system with its frequencies, in place of their squares, as declared parameters."""
    plain = random_potential(dimension)
    names = [f"w{i}" for i in range(dimension)]
    others = list(plain.parameters)[dimension:]

    def V(q: Any, *given: Any) -> Any:
        return plain.V(q, *(w * w for w in given[:dimension]), *given[dimension:])

    # Different values, because coordinates of one frequency would share its rotation.
    frequencies = {name: Parameter(value=f"0.{i + 1}") for i, name in enumerate(names)}
    return replace(
        plain, name=f"declared_potential_{dimension}", V=V, frequencies=tuple(names),
        parameters=frequencies | {name: plain.parameters[name] for name in others},
    )  # fmt: skip


def with_exact_oscillators(ensemble: Ensemble) -> Ensemble:
    """Return random potentials whose oscillators are solved exactly."""
    dimension = ensemble.start.shape[1] // 4
    parameters = ensemble.parameters.copy()
    frequencies = np.sqrt(parameters[:, : 2 * dimension : 2])
    parameters[:, : 2 * dimension : 2] = frequencies
    return replace(
        ensemble, name=f"{ensemble.name}, oscillators exact", system=declared_potential(dimension),
        parameters=parameters, frequencies=frequencies,
    )  # fmt: skip


def random_ensemble(dimension: int, count: int, seed: int, *, band: tuple[float, float], t_end: float) -> Ensemble:
    """Return ``count`` random systems of 2 or 3 coordinates with their starts.

    ``band`` are the bounds of the strength, and ``t_end`` the length of every run, in radians of the frequency 1.
    """
    system, random = random_potential(dimension), np.random.default_rng([seed, dimension, count])
    start = np.zeros((count, 4, dimension))
    parameters = np.zeros((count, len(system.parameters), 2))
    strength = _log_uniform(random, band, count)
    for i, s in enumerate(strength):
        w: Floats = random.uniform(*FREQUENCIES, dimension)
        w[random.integers(dimension)] = 1.0
        cubic = random.normal(size=dimension**2) * DEVIATION * s
        quartic = (np.abs(random.normal(size=dimension * (dimension + 1) // 2)) * DEVIATION + LEAST) * s
        mixed = random.normal(size=len(system.parameters) - dimension - cubic.size - quartic.size) * DEVIATION * s
        parameters[i, :, 0] = np.concatenate([w**2, cubic, quartic, mixed])
        amplitude = random.uniform(*AMPLITUDES) * np.sqrt(random.dirichlet(np.ones(dimension)))
        phase = random.uniform(0.0, 2 * np.pi, dimension)
        start[i, 0], start[i, 2] = amplitude * cos(phase) / np.maximum(w, SOFTEST), amplitude * sin(phase)
    return Ensemble(
        name=f"d = {dimension}, {band[0]:g} to {band[1]:g}", system=system, start=start.reshape(count, -1),
        parameters=parameters.reshape(count, -1), t_end=t_end, strength=strength,
    )  # fmt: skip


# --- Model crystals drawn at random: rings of masses in turns, with cubic and quartic bonds, in thermal equilibrium.
#
#     V = sum_i k_i (d_i^2 / 2 - d_i^3 / 2 + c d_i^4),  d_i = w_(i+1) q_(i+1) - w_i q_i
#
# q are coordinates times the square roots of the masses, so that T = p.p/2. The unit of length is the softness of the
# bonds, the length for which the cubic term of every pair potential of this form is -d^3/2. Then c is 7/24 for
# Morse's bond and 53/168 for Lennard-Jones's; it is uniform between the two. The ratio of the masses is log-
# uniform from 1 to 4, and so are all k_i from 0.7 to 1.4. The highest frequency is 1. Every phonon has random
# coordinates and momenta of one temperature, which makes the rms change of a bond log-uniform in a band, as long as
# bonds are harmonic. The total momentum is 0.

#: Masses of a ring, the largest ratio of two of them, and the bounds of the strengths of bonds.
SITES, RATIO, BONDS = 8, 4.0, (0.7, 1.4)
#: Coefficient of d^4 for Morse's bond and for Lennard-Jones's: V''''/V'' over 24, and over (V'''/(3 V''))^2.
QUARTIC = (7 / 24, 53 / 168)


@cache
def ring() -> System:
    """Return the system whose parameters are the inverse roots of the masses, k, and c."""
    names = [*(f"w{i}" for i in range(SITES)), *(f"k{i}" for i in range(SITES)), "c"]

    def V(q: Any, *given: Any) -> Any:
        w, k, c = given[:SITES], given[SITES : 2 * SITES], given[-1]
        places = [a * x for a, x in zip(w, q, strict=True)]
        bonds = zip(k, places, [*places[1:], places[0]], strict=True)
        return sum(strength * _bond(b - a, c) for strength, a, b in bonds)

    return _drawn("random_ring", "random ring", V, SITES, names)


def _bond(d: Any, c: Any) -> Any:
    square = d * d
    return square * (0.5 - 0.5 * d + c * square)


def ring_ensemble(count: int, seed: int, *, band: tuple[float, float], t_end: float) -> Ensemble:
    """Return ``count`` rings with their starts.

    ``band`` are the bounds of the rms change of a bond, and ``t_end`` the length of every run, in radians of the
    highest frequency.
    """
    random = np.random.default_rng([seed, SITES, count])
    strength = _log_uniform(random, band, count)
    masses = np.ones((count, SITES))
    masses[:, 1::2] = _log_uniform(random, (1.0, RATIO), (count, 1))
    k = _log_uniform(random, BONDS, (count, SITES))
    w = 1 / np.sqrt(masses)
    squares, modes = eigen(_hessians(w, k))
    w /= np.sqrt(squares[:, -1:])
    frequencies = np.sqrt(squares[:, 1:] / squares[:, -1:])
    start = np.zeros((count, 4, SITES))
    parameters = np.zeros((count, 2 * SITES + 1, 2))
    parameters[:, :, 0] = np.concatenate([w, k, random.uniform(*QUARTIC, (count, 1))], axis=1)
    for i in range(count):
        phonons = modes[i, :, 1:].T
        changes = w[i] * phonons / frequencies[i, :, None]
        rms = np.sqrt(np.mean(np.sum((np.roll(changes, -1, axis=1) - changes) ** 2, axis=0)))
        scaled = strength[i] / rms * random.normal(size=(2, SITES - 1))
        start[i, 0] = product(scaled[0] / frequencies[i], phonons)
        start[i, 2] = product(scaled[1], phonons)
    return Ensemble(
        name=f"rings, {band[0]:g} to {band[1]:g}", system=ring(), start=start.reshape(count, -1),
        parameters=parameters.reshape(count, -1), t_end=t_end, strength=strength,
    )  # fmt: skip


def _hessians(w: Floats, k: Floats) -> Floats:
    """Return V'' (count, n, n) at rest."""
    n, after = w.shape[1], np.roll(w, -1, axis=1)
    found = np.zeros((len(w), n, n))
    for i in range(n):
        j = (i + 1) % n
        found[:, i, i] += k[:, i] * w[:, i] ** 2
        found[:, j, j] += k[:, i] * after[:, i] ** 2
        found[:, i, j] -= k[:, i] * w[:, i] * after[:, i]
        found[:, j, i] = found[:, i, j]
    return found
