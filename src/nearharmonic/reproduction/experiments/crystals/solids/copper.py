"""Copper: effective medium theory on a face-centred cubic lattice."""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from nearharmonic.numerics.compiled import compiled, exponential
from nearharmonic.reproduction.experiments.crystals.solids.lattice import FCC, Pairs, cubic, pairs_within
from nearharmonic.reproduction.experiments.crystals.solids.solid import BOLTZMANN, FEMTOSECONDS, Solid

BOHR = 0.529177210903
#: Parameters of Jacobsen, Stoltze and Norskov (1996): eV, Angstrom, 1/Angstrom; beta is (16 pi / 3)^(1/3) / sqrt 2.
E0, S0, V0, ETA, KAPPA, LAMBDA = -3.51, 2.67 * BOHR, 2.476, 1.652 / BOHR, 2.740 / BOHR, 1.906 / BOHR
BETA = 1.809399790563555
#: Centre of the smooth cut-off, between the third and the fourth shell, and its inverse width.
MIDDLE = BETA * S0 * 0.5 * (sqrt(3) + sqrt(4))
STEEP = log(9999.0) / (MIDDLE * 2 * sqrt(4) / (sqrt(3) + sqrt(4)) - MIDDLE)
REACH = MIDDLE + 0.5
#: Edge of the cubic cell at the minimum of the energy, in Angstrom.
EDGE = 3.5937


def _shells(decay: float) -> float:
    """Sum over the first three shells at the equilibrium distance: it makes the sum over neighbours 12 there."""
    distances = [BETA * S0 * sqrt(n) for n in (1, 2, 3)]
    counts = (12, 6, 24)
    return sum(
        count / 12 / (1 + float(np.exp(STEEP * (one - MIDDLE)))) * float(np.exp(-decay * (one - BETA * S0)))
        for count, one in zip(counts, distances, strict=True)
    )


GAMMA_1, GAMMA_2 = _shells(ETA), _shells(KAPPA / BETA)


def gradient_of(atoms: int, pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for a list of pairs in Angstrom; energies in eV."""
    first, second, vector = pairs

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        density, slopes, unit = np.zeros(atoms), np.empty(len(first)), np.empty((len(first), 3))
        total = 0.0
        for k in range(len(first)):
            i, j = first[k], second[k]
            x, y, z = vector[k, 0] + u[j] - u[i], vector[k, 1] + u[j + 1] - u[i + 1], vector[k, 2] + u[j + 2] - u[i + 2]
            r = sqrt(x * x + y * y + z * z)
            rise = exponential(STEEP * (r - MIDDLE))
            kept = 1.0 / (1.0 + rise)
            falls = -STEEP * rise * kept
            sigma = exponential(-ETA * (r - BETA * S0)) * kept / GAMMA_1
            pair = V0 * exponential(-KAPPA * (r / BETA - S0)) * kept / GAMMA_2
            density[i // 3] += sigma
            density[j // 3] += sigma
            slopes[k] = sigma * (falls - ETA)
            total -= pair
            unit[k, 0], unit[k, 1], unit[k, 2] = x / r, y / r, z / r
            slope = -pair * (falls - KAPPA / BETA)
            for c in range(3):
                out[j + c] += slope * unit[k, c]
                out[i + c] -= slope * unit[k, c]
        for atom in range(atoms):
            scale = -logarithm(density[atom] / 12.0) / (BETA * ETA)
            x = LAMBDA * scale
            fall, repelled = exponential(-x), 6.0 * V0 * exponential(-KAPPA * scale)
            total += E0 * ((1.0 + x) * fall - 1.0) + repelled
            density[atom] = -(-E0 * x * fall * LAMBDA - KAPPA * repelled) / (BETA * ETA * density[atom])
        for k in range(len(first)):
            i, j = first[k], second[k]
            slope = (density[i // 3] + density[j // 3]) * slopes[k]
            for c in range(3):
                out[j + c] += slope * unit[k, c]
                out[i + c] -= slope * unit[k, c]
        return total

    return gradient


@compiled
def logarithm(x):  # type: ignore[no-untyped-def]
    """Return the logarithm of a number near 1 by Newton's method on :func:`exponential`, equal on every processor."""
    y = (x - 1.0) / (0.5 * (x + 1.0))
    for _ in range(4):
        left = exponential(y)
        y += 2.0 * (x - left) / (x + left)
    return y


def copper(cells: int) -> Solid:
    """Return a crystal of 4 cells^3 atoms."""
    sites = cubic(FCC, EDGE, cells)
    return Solid(
        name="copper",
        label="copper (effective medium theory)",
        masses=np.full(sites.size, 63.546),
        gradient=gradient_of(len(sites), pairs_within(sites, cells * EDGE, REACH)),
        melting=1358 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Jacobsen, Stoltze & Norskov (1996), Surf. Sci. 366, 394, doi:10.1016/0039-6028(96)00816-3",
    )
