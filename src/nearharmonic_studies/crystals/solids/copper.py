"""Copper: effective medium theory on a face-centred cubic lattice."""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from nearharmonic.numerics.compiled import compiled, exponential
from nearharmonic_studies.crystals.solids.lattice import FCC, Pairs, cubic, pairs_within, pull
from nearharmonic_studies.crystals.solids.solid import BOLTZMANN, FEMTOSECONDS, Solid

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
    first, second, between, count = pairs.i, pairs.j, np.ascontiguousarray(pairs.vector.T), len(pairs.i)
    atom_i, atom_j = first // 3, second // 3

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        d, density = np.empty((3, count)), np.zeros(atoms)
        sigma, pair, slopes, pulls = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
        for k in range(count):
            i, j = first[k], second[k]
            for c in range(3):
                d[c, k] = between[c, k] + u[j + c] - u[i + c]
        # Several pairs in a vector.
        for k in range(count):
            r = sqrt(d[0, k] * d[0, k] + d[1, k] * d[1, k] + d[2, k] * d[2, k])
            rise = exponential(STEEP * (r - MIDDLE))
            kept = 1.0 / (1.0 + rise)
            falls = -STEEP * rise * kept
            sigma[k] = exponential(-ETA * (r - BETA * S0)) * kept / GAMMA_1
            pair[k] = V0 * exponential(-KAPPA * (r / BETA - S0)) * kept / GAMMA_2
            slopes[k], pulls[k] = sigma[k] * (falls - ETA), -pair[k] * (falls - KAPPA / BETA)
            d[0, k], d[1, k], d[2, k] = d[0, k] / r, d[1, k] / r, d[2, k] / r
        total = 0.0
        for k in range(count):
            i, j = first[k], second[k]
            density[atom_i[k]] += sigma[k]
            density[atom_j[k]] += sigma[k]
            total -= pair[k]
            pull(out, i, j, pulls[k], d, k)
        for atom in range(atoms):
            scale = -logarithm(density[atom] / 12.0) / (BETA * ETA)
            x = LAMBDA * scale
            fall, repelled = exponential(-x), 6.0 * V0 * exponential(-KAPPA * scale)
            total += E0 * ((1.0 + x) * fall - 1.0) + repelled
            density[atom] = -(-E0 * x * fall * LAMBDA - KAPPA * repelled) / (BETA * ETA * density[atom])
        for k in range(count):
            i, j = first[k], second[k]
            pull(out, i, j, (density[atom_i[k]] + density[atom_j[k]]) * slopes[k], d, k)
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
