"""A chain of two masses in turns, whose neighbours are bound by Morse's potential."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np

from nearharmonic.numerics.compiled import compiled, exponential
from nearharmonic_studies.crystals.solids.solid import Solid

#: Masses in turns, and the inverse width of the bond; its depth is 1.
LIGHT, HEAVY, WIDTH = 1.0, 3.0, 1.0
#: k_B T in place of a melting point, which a chain does not have: a tenth of the depth of a bond.
HIGHEST = 0.1


def gradient_of(sites: int) -> Any:
    """Return the gradient of V = sum (1 - exp(-a d))^2 over the bonds of a ring, compiled."""

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        left = np.empty(sites)
        for i in range(sites - 1):
            left[i] = exponential(-WIDTH * (u[i + 1] - u[i]))
        left[sites - 1] = exponential(-WIDTH * (u[0] - u[sites - 1]))
        before, total = 0.0, 0.0
        for i in range(sites):
            total += (1.0 - left[i]) * (1.0 - left[i])
            slope = 2.0 * WIDTH * left[i] * (1.0 - left[i])
            out[i] = before - slope
            before = slope
        out[0] += before
        return total

    return gradient


def chain(cells: int) -> Solid:
    """Return a ring of 2 ``cells`` masses."""
    return Solid(
        name="chain",
        label="diatomic chain (Morse)",
        masses=np.array([LIGHT, HEAVY] * cells),
        gradient=gradient_of(2 * cells),
        melting=HIGHEST,
        unit=nan,
        source="Morse (1929), Phys. Rev. 34, 57, doi:10.1103/PhysRev.34.57",
    )
