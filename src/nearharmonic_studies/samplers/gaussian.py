r"""Acceptance and squared jumps of Hamiltonian Monte Carlo on Gaussians, exactly, without chains.

In units of standard deviations a trajectory multiplies (q, p) of each mode by a matrix [[c, x s], [-s/x, c]] with
c^2 + s^2 = 1. Its energy error is a form of two normal numbers, whose characteristic function at u + i/2 is
(1 + g (u^2 + 1/4))^(-1/2) with g = (x - 1/x)^2 s^2. With u = tan(a)/2 the mean of min(1, exp(-dH)) over independent
modes is (2/pi) times the integral over a from 0 to pi/2 of the product of (1 + g/(4 cos^2 a))^(-1/2); the mean squared
jump has the same form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, exp, log
from nearharmonic.numerics.portable import Floats
from nearharmonic_studies.samplers.chains import JITTER

#: Nodes of the integral over a: the midpoint rule, whose integrand is smooth and periodic.
NODES = 48
#: Modes of different frequency; a Gaussian of more dimensions has several of each. Lengths of the jitter.
FREQUENCIES, JITTER_LENGTHS = 100, 9


class Spectrum(NamedTuple):
    """Frequencies (k,) of a Gaussian, ascending, and the number of modes with each."""

    frequencies: Floats
    modes: float


class Found(NamedTuple):
    """Gradients over the least mean squared jump, in units of twice the variance, and the acceptance."""

    gradients: float
    acceptance: float


def spectrum(dimension: int, ratio: float) -> Spectrum:
    """Return frequencies log-uniform from 1/ratio to 1."""
    count = min(FREQUENCIES, dimension)
    return Spectrum(np.array(exp(-log(ratio) * (1 - (np.arange(count) + 0.5) / count))), dimension / count)


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


def efficiency(method: Tableau, tau: float, length: float, on: Spectrum) -> Found:
    """Return the gradients of trajectories of about ``length``, over the least squared jump of all modes."""
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
    return Found(gradients / least if least > 0 else np.inf, acceptance)


def best(
    method: Tableau, taus_per_stage: Sequence[float], lengths: Sequence[float], on: Spectrum
) -> tuple[Found, float, float]:
    """Return the fewest gradients over all step sizes and lengths, and where they are."""
    every = [
        (efficiency(method, tau * method.stages, length, on), tau, length)
        for length in lengths
        for tau in taus_per_stage
    ]
    return min(every, key=lambda one: one[0].gradients)
