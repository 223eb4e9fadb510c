"""Near-harmonic systems drawn at random: potentials to degree four in two or three coordinates.

    V = sum_i q_i^2 (w_i^2 / 2 + sum_j c_ij q_j + sum_(j >= i) e_ij q_j^2) + sum_(i < j < k) c_ijk q_i q_j q_k

One frequency is 1, the others are uniform in [0.2, 1]. The strength s is log-uniform in a band; every cubic coefficient
is normal with the deviation 0.4 s, every quartic one 0.1 s plus the modulus of such a number. All quartic coefficients
are positive, so that H is bounded from below for every draw. The amplitude is uniform in [0.4, 1]; its square is
distributed over the coordinates uniformly on the simplex; phases are uniform. A momentum is an amplitude times a sine.
A coordinate is an amplitude times a cosine, divided by the frequency or 0.5, whichever is larger.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations
from math import prod
from typing import Any

import numpy as np

from nearharmonic.math import cos, exp, log, sin
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.system import System
from nearharmonic.training.population import Ensemble

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
        total = sum(
            squares[i]
            * (
                of[f"a{i}"] / 2
                + sum(of[f"c{i}{j}"] * q[j] for j in range(dimension))
                + sum(of[f"e{i}{j}"] * squares[j] for j in range(i, dimension))
            )
            for i in range(dimension)
        )
        return total + sum(of["c" + "".join(map(str, t))] * prod(q[i] for i in t) for t in triples)

    point = ["0.25"] * dimension
    return System(
        name=f"random_potential_{dimension}", label=f"random potential, d = {dimension}", V=V, q0=tuple(point),
        p0=tuple(point), t_end="100", parameters=dict.fromkeys(names, Parameter(value="0.125")),
        source="drawn at random: nearharmonic_studies.trained.problems.random_potentials",
    )  # fmt: skip


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
    low, high = map(log, band)
    strength = exp(random.uniform(low, high, count))
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
