"""Argon: the Lennard-Jones potential with a switched cut-off on a face-centred cubic lattice."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from nearharmonic.numerics.compiled import compiled
from nearharmonic_studies.crystals.solids.lattice import FCC, Pairs, cubic, pairs_within, pull
from nearharmonic_studies.crystals.solids.solid import BOLTZMANN, FEMTOSECONDS, Solid

#: Depth in eV (119.8 K) and diameter in Angstrom: Rahman (1964), Phys. Rev. 136, A405.
DEPTH, DIAMETER = 119.8 * BOLTZMANN, 3.405
#: The potential is switched off from the first to the second distance, in diameters. Forces act between neighbours
#: whose sites are nearer than the third: four shells, 54 neighbours.
SWITCH, CUTOFF, REACH = 2.0, 2.25, 2.3
#: Edge of the cubic cell without pressure at 0 K, with this cut-off, in diameters.
EDGE = 1.5519


@compiled
def pair(square):  # type: ignore[no-untyped-def]
    """Return the energy of a pair at a squared distance, in units of depth and diameter, and its derivative by it."""
    inverse = 1.0 / square
    s6 = inverse * inverse * inverse
    energy, slope = 4.0 * s6 * (s6 - 1.0), -12.0 * s6 * (2.0 * s6 - 1.0) * inverse
    distance = sqrt(square)
    x = (distance - SWITCH) / (CUTOFF - SWITCH)
    left = 1.0 + x * x * x * (-10.0 + x * (15.0 - 6.0 * x))
    falls = -30.0 * x * x * (1.0 - x) * (1.0 - x) / (CUTOFF - SWITCH)
    near, far = square <= SWITCH * SWITCH, square >= CUTOFF * CUTOFF
    switched = 0.0 if far else slope * left + energy * falls / (2.0 * distance)
    slope = slope if near else switched
    energy *= 1.0 if near else (0.0 if far else left)
    return energy, slope


def gradient_of(pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for a list of pairs in Angstrom; energies in eV."""
    first, second, scale = pairs.i, pairs.j, 1.0 / DIAMETER
    between = np.ascontiguousarray(pairs.vector.T) / DIAMETER
    count = len(first)

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        d, slopes, energies = np.empty((3, count)), np.empty(count), np.empty(count)
        for k in range(count):
            i, j = first[k], second[k]
            for c in range(3):
                d[c, k] = between[c, k] + (u[j + c] - u[i + c]) * scale
        # Several pairs in a vector.
        for k in range(count):
            energies[k], slopes[k] = pair(d[0, k] * d[0, k] + d[1, k] * d[1, k] + d[2, k] * d[2, k])
            slopes[k] *= 2.0 * DEPTH * scale
        total = 0.0
        for k in range(count):
            i, j = first[k], second[k]
            total += energies[k]
            pull(out, i, j, slopes[k], d, k)
        return DEPTH * total

    return gradient


def argon(cells: int) -> Solid:
    """Return a crystal of 4 cells^3 atoms."""
    edge = EDGE * DIAMETER
    sites = cubic(FCC, edge, cells)
    return Solid(
        name="argon",
        label="argon (Lennard-Jones)",
        masses=np.full(sites.size, 39.948),
        gradient=gradient_of(pairs_within(sites, cells * edge, REACH * DIAMETER)),
        melting=83.8 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Rahman (1964), Phys. Rev. 136, A405, doi:10.1103/PhysRev.136.A405",
    )
