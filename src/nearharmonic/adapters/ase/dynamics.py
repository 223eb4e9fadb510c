"""Molecular dynamics of ASE by a splitting method."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from ase import Atoms
from ase.constraints import ExternalForce, FixAtoms, FixCartesian, FixedLine, FixedPlane, Hookean
from ase.md.md import MolecularDynamics

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.exchange.method import method_for
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.written import is_real

#: Constraints that are linear in positions and momenta alike, or forces: kicks and drifts remain exact flows.
LINEAR = (FixAtoms, FixCartesian, FixedLine, FixedPlane, Hookean, ExternalForce)


class Splitting(MolecularDynamics):  # type: ignore[misc]  # ASE has no types
    """Molecular dynamics at constant energy by a splitting method of kicks and drifts.

    A step evaluates as many forces as the method has stages. The last kick of a step and the first of the next share
    one: the calculator keeps it with its positions, as all calculators of ASE do, so a change of atoms, cell or momenta
    between two steps never meets an old force. The roles are those of the method. A method that begins with a drift
    ends with one, and its last positions need no force: it costs one more force in each step whose forces an observer,
    a trajectory or a log asks for. The kinetic energy is quadratic, so Nystrom methods keep their order.

    Fixed atoms, coordinates, lines and planes are exact, as are Hookean restraints and external forces. Fixed bond
    lengths and other constraints raise an error: a drift along them is no straight line, and the order falls to 2.

    Parameters
    ----------
    atoms : ase.Atoms
        Atoms with a calculator. Atoms without momenta begin at rest.
    step : float
        Size of a whole step, above 0, in ASE's unit of time: ``5 * ase.units.fs``. The time of a force is
        ``step / stages``.
    method : str or Tableau
        Name of an integrator, path of a file, or a tableau, of plain kicks and drifts.
    trajectory : str, Path or ase.io.Trajectory, optional
        File or object to which configurations are written.
    logfile : str or file, optional
        File of a log of energies and temperatures; "-" prints it.
    loginterval : int
        Steps between two configurations in the trajectory, and between two lines of the log.
    **more
        Further arguments of ``ase.md.md.MolecularDynamics``, such as ``append_trajectory``.

    Raises
    ------
    NearharmonicError
        An unknown method, one with modified potentials or a processor, a bad step, a mass that is not positive of an
        atom that may move, or a constraint that is not linear.

    Notes
    -----
    The hook is ``ase.md.md.MolecularDynamics``, the class of ASE's own dynamics; ``"verlet"`` is
    ``ase.md.verlet.VelocityVerlet``.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> from ase import units
    >>> from ase.build import bulk
    >>> from ase.calculators.emt import EMT
    >>> atoms = bulk("Cu", cubic=True)
    >>> atoms.calc = EMT()
    >>> nh.adapters.ase.Splitting(atoms, 28 * units.fs, "babs7o7h").run(2)
    True
    """

    def __init__(
        self,
        atoms: Atoms,
        step: float,
        method: str | Tableau,
        *,
        trajectory: Any = None,
        logfile: Any = None,
        loginterval: int = 1,
        **more: Any,
    ) -> None:
        if not isinstance(atoms, Atoms):
            raise bad_setting("atoms", atoms, "an ase.Atoms")
        self.method = method_for("ASE", method)
        size = positive("step", step, "a time above 0 in ASE's unit, such as 5 * ase.units.fs")
        masses_of(atoms)
        check_constraints(atoms)
        super().__init__(atoms, size, trajectory=trajectory, logfile=logfile, loginterval=loginterval, **more)

    def step(self) -> None:
        """Take one step."""
        atoms = self.atoms
        check_constraints(atoms)
        masses = masses_of(atoms)
        for move in self.method.moves:
            if move.coefficient == 0:  # a kick would evaluate a force for nothing
                continue
            length = move.coefficient * self.dt
            if move.flow == "kick":
                atoms.set_momenta(atoms.get_momenta() + length * atoms.get_forces(md=True))
            else:
                atoms.set_positions(atoms.get_positions() + length * atoms.get_momenta() / masses)

    def todict(self) -> dict[str, Any]:
        """Return what a trajectory writes about its dynamics, with the name of the method."""
        return {**super().todict(), "method": self.method.tableau.name}

    def call_observers(self) -> None:
        """Call the observers that are due; after a last drift they find energy and forces of the last positions."""
        intervals = [interval for _, interval, _, _ in self.observers]
        due = any(self.nsteps % one == 0 if one > 0 else self.nsteps == -one for one in intervals)
        if due and self.method.first == "drift":
            self.atoms.get_forces()
        super().call_observers()

    def _refresh_properties(self) -> None:
        """Evaluate forces at the end of a step for ASE, unless they would be thrown away."""
        if self.method.first == "kick":
            super()._refresh_properties()


def positive(key: str, given: Any, allowed: str) -> float:
    """Return a finite number above 0 as a float; a user may pass anything."""
    if not is_real(given) or not (isfinite(given) and float(given) > 0):
        raise bad_setting(key, given, allowed)
    return float(given)


def masses_of(atoms: Atoms) -> np.ndarray:
    """Return the masses as a column; those of fixed atoms are 1, as they may be 0 and their momenta are."""
    masses = np.array(atoms.get_masses(), dtype=float)
    for constraint in atoms.constraints:
        if isinstance(constraint, FixAtoms):
            masses[constraint.index] = 1
    bad = np.flatnonzero(~((masses > 0) & np.isfinite(masses)))
    if bad.size:
        raise bad_setting(f"mass of atom {bad[0]}", masses[bad[0]], "a number above 0, unless FixAtoms holds the atom")
    return masses[:, np.newaxis]


def check_constraints(atoms: Atoms) -> None:
    """Raise an error for a constraint along which a drift is no straight line."""
    for constraint in atoms.constraints:
        if not isinstance(constraint, LINEAR):
            raise SettingError(
                f"constraint {type(constraint).__name__}: a drift along it is no straight line, so the order falls; "
                f"possible are {', '.join(one.__name__ for one in LINEAR)}"
            )
