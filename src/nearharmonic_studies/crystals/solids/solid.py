"""A crystal as a mechanical system: masses, the gradient of V in displacements, and its phonons at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nearharmonic.numerics.portable import Floats

#: Boltzmann constant in eV/K (exact in the SI of 2019), and the unit of time, Angstrom (u/eV)^(1/2), in femtoseconds.
BOLTZMANN, FEMTOSECONDS = 8.617333262e-5, 10.180505710

#: Displacement of the difference of gradients that gives the Hessian, in units of length: truncation ~ 1e-6 of it.
DIFFERENCE = 1e-4


@dataclass(frozen=True)
class Solid:
    """A crystal.

    ``name``, ``label``, ``source``: name, name in figures, and origin of the potential. ``masses`` (n,): mass
    of each coordinate. ``gradient(u, out)``: numba function that writes dV/du (n,) into ``out`` and
    returns V. ``melting``: k_B T at the melting point, in units of energy. ``unit``: unit of time in femtoseconds; NaN
    for a model without units.
    """

    name: str
    label: str
    masses: Floats
    gradient: Callable[[Floats, Floats], float]
    melting: float
    unit: float
    source: str

    @property
    def coordinates(self) -> int:
        """Number of coordinates, n."""
        return len(self.masses)

    def hessian(self, u: Floats) -> Floats:
        """Return the Hessian (n, n) of V at u with inverse masses, whose eigenvalues are squares of frequencies."""
        n, columns = self.coordinates, []
        above, below, moved = np.empty(n), np.empty(n), u.copy()
        for k in range(n):
            for sign, out in ((1.0, above), (-1.0, below)):
                moved[k] = u[k] + sign * DIFFERENCE
                self.gradient(moved, out)
            moved[k] = u[k]
            columns.append((above - below) / (2 * DIFFERENCE))
        weights = 1 / np.sqrt(self.masses)
        found = np.array(columns) * weights[:, None] * weights[None, :]
        return (found + found.T) / 2

    @cached_property
    def frequencies(self) -> Floats:
        """Angular frequencies (n,) of the phonons at rest, ascending, to six digits; those of translations are 0.

        LAPACK rounds differently on other processors, by much less than the last of six digits.
        """
        squares = np.linalg.eigvalsh(self.hessian(np.zeros(self.coordinates)))
        kept = np.where(squares > 1e-6 * squares[-1], squares, 0.0)
        return np.array([float(f"{one:.6g}") for one in np.sqrt(kept)])

    @property
    def period(self) -> float:
        """Period of the fastest phonon."""
        return 2 * np.pi / float(self.frequencies[-1])
