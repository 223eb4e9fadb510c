"""Silicon: the potential of Stillinger and Weber on a diamond lattice."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from nearharmonic.numerics.compiled import compiled, exponential
from nearharmonic_studies.crystals.solids.lattice import DIAMOND, Pairs, cubic, pairs_within
from nearharmonic_studies.crystals.solids.solid import BOLTZMANN, FEMTOSECONDS, Solid

#: Depth in eV and length in Angstrom; cut-off, and coefficients of pairs and triplets, in these units.
DEPTH, LENGTH, CUTOFF = 2.16826, 2.0951, 1.80
A, B, TRIPLETS, DECAY = 7.049556277, 0.6022245584, 21.0, 1.20
#: Edge of the cubic cell at the minimum of the energy, in Angstrom, and the distance to which neighbours are listed.
EDGE, REACH = 5.43095, 4.5


def gradient_of(atoms: int, pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for the neighbours of each atom in Angstrom; energies in eV."""
    _, second, vector = pairs
    each = len(second) // atoms

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        total = 0.0
        near, d, r, factor = np.empty(each, np.int64), np.empty((each, 3)), np.empty(each), np.empty(each)
        for atom in range(atoms):
            i, count = 3 * atom, 0
            for k in range(atom * each, (atom + 1) * each):
                j, square = second[k], 0.0
                for c in range(3):
                    d[count, c] = (vector[k, c] + u[j + c] - u[i + c]) / LENGTH
                    square += d[count, c] * d[count, c]
                if square < CUTOFF * CUTOFF:
                    r[count], near[count] = sqrt(square), j
                    count += 1
            for a in range(count):
                left, j = 1.0 / (r[a] - CUTOFF), near[a]
                tail, fourth = exponential(left), B / (r[a] * r[a] * r[a] * r[a])
                # Each pair is met at both of its atoms: half of its energy here, half of its force on each.
                total += 0.5 * A * (fourth - 1.0) * tail
                slope = 0.5 * A * tail * (-4.0 * fourth / r[a] - (fourth - 1.0) * left * left) / r[a]
                for c in range(3):
                    out[j + c] += slope * d[a, c]
                    out[i + c] -= slope * d[a, c]
                factor[a] = exponential(DECAY * left)
            for a in range(count):
                for b in range(a):
                    cosine = (d[a, 0] * d[b, 0] + d[a, 1] * d[b, 1] + d[a, 2] * d[b, 2]) / (r[a] * r[b])
                    angle = cosine + 1.0 / 3.0
                    size = TRIPLETS * factor[a] * factor[b]
                    total += size * angle * angle
                    bend, left_a, left_b = 2.0 * size * angle, 1.0 / (r[a] - CUTOFF), 1.0 / (r[b] - CUTOFF)
                    along_a = -size * angle * angle * DECAY * left_a * left_a / r[a] - bend * cosine / (r[a] * r[a])
                    along_b = -size * angle * angle * DECAY * left_b * left_b / r[b] - bend * cosine / (r[b] * r[b])
                    across = bend / (r[a] * r[b])
                    for c in range(3):
                        on_a = along_a * d[a, c] + across * d[b, c]
                        on_b = along_b * d[b, c] + across * d[a, c]
                        out[near[a] + c] += on_a
                        out[near[b] + c] += on_b
                        out[i + c] -= on_a + on_b
        for k in range(len(out)):
            out[k] *= DEPTH / LENGTH
        return DEPTH * total

    return gradient


def silicon(cells: int) -> Solid:
    """Return a crystal of 8 cells^3 atoms."""
    sites = cubic(DIAMOND, EDGE, cells)
    return Solid(
        name="silicon",
        label="silicon (Stillinger-Weber)",
        masses=np.full(sites.size, 28.085),
        gradient=gradient_of(len(sites), pairs_within(sites, cells * EDGE, REACH, both=True)),
        melting=1687 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Stillinger & Weber (1985), Phys. Rev. B 31, 5262, doi:10.1103/PhysRevB.31.5262",
    )
