"""Potential and kinetic energy of a system, as expressions that are traced at first use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.definition.extended import ExtendedPotential, with_parameters
from nearharmonic.systems.definition.members import Members
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.formulas.energy import Energy
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy, quadratic_T
from nearharmonic.systems.numba.potential import NumbaEnergy, numba_potential


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Energies(Members):
    """The energies of a system, and properties of its kinetic energy."""

    @cached_property
    def _potential(self) -> Energy:
        numba = numba_potential(self)
        if numba is not None:
            return NumbaEnergy(numba, self.constants(Constant))
        V = ExtendedPotential(self.V) if self.time_dependent else self.V
        return Energy(self.name, "V", V, self.dimension + self.time_dependent, self.constants(Constant))

    @cached_property
    def _kinetic_energy(self) -> Energy:
        T = with_parameters(self.T, len(self.parameters))
        return Energy(self.name, "T", T, self.dimension, self.constants(Constant))

    @property
    def energies(self) -> tuple[Energy, Energy]:
        """V and T. V is a function of the coordinates, and of time if it depends on time."""
        return self._potential, self._kinetic_energy

    @cached_property
    def quadratic_kinetic_energy(self) -> bool:
        """True if T is a polynomial of degree at most 2 in the momenta, as Nystrom methods require."""
        return self.T is quadratic_T or isinstance(self.T, MassKineticEnergy) or self._kinetic_energy.is_quadratic

    @cached_property
    def unit_masses(self) -> bool:
        """True if T = p.p / 2: accelerations are then minus grad_V."""
        return self.T is quadratic_T or self._kinetic_energy.is_half_square

    @cached_property
    def typical_energy(self) -> float:
        """T(p0) + max |V(q0, t)| to two digits, over 17 times of the interval; 0 if V does not depend on time.

        The energy at the start of a system that depends on time may be near 0 by accident.
        """
        if not self.time_dependent:
            return 0.0
        constants, times = self.constants(float), (float(self.t_end) * k / 16 for k in range(17))
        q0, p0 = (tuple(map(float, x)) for x in (self.q0, self.p0))
        V = max(abs(float(self.V(q0, t, *constants))) for t in times)
        return float(f"{float(self._kinetic_energy.function(p0, *constants)) + V:.2g}")

    def energy(self, q: Vector, p: Vector, constants: Sequence[Any] = (), t: Any = None) -> Any:
        """Return H = T(p) + V(q), or T(p) + V(q, t).

        Parameters
        ----------
        q, p : tuple of d numbers or arrays
            State, in any number type.
        constants : sequence of numbers
            Parameters in the same type, from :meth:`constants`.
        t : number or array
            Time, if V depends on it.

        Raises
        ------
        SystemDefinitionError
            V depends on time, and ``t`` is not given.
        """
        if self.time_dependent and t is None:
            raise SystemDefinitionError(f"{self.name}: V depends on time, and its energy needs t")
        time = (t,) if self.time_dependent else ()
        return self._kinetic_energy.function(p, *constants) + self.V(q, *time, *constants)
