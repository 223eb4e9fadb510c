"""ASE: a method as molecular dynamics at constant energy, and a trial of methods on the atoms of a user."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil, floor, inf, isfinite, log10
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
from ase import Atoms, units
from ase.calculators.calculator import BaseCalculator, CalculatorError, PropertyNotImplementedError
from ase.constraints import ExternalForce, FixAtoms, FixCartesian, FixedLine, FixedPlane, Hookean
from ase.md.md import MolecularDynamics

from nearharmonic.errors import RefusedError, SettingError, bad_setting
from nearharmonic.exchange.method import Method, VelocityCheck, method_for
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.written import is_real
from nearharmonic.output.store import assembled, coordinate, variable
from nearharmonic.recommendation.measure import fewest_steps

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Splitting", "recommend"]

#: Constraints that are linear in positions and momenta alike, or forces: kicks and drifts remain exact flows.
LINEAR = (FixAtoms, FixCartesian, FixedLine, FixedPlane, Hookean, ExternalForce)
#: Methods of plain kicks and drifts that are tried by default: leapfrog, methods of order 2 for few forces and large
#: steps, and near-harmonic and trained methods for smaller errors.
CANDIDATES = (
    "leapfrog", "predescu_s3", "bcss_s4", "babps6o5h", "babs6o7h", "babs7o7h", "trained_coarse", "trained_light",
)  # fmt: skip
#: Longest way of an atom between two forces of the largest step tried, in angstrom: about a tenth of a bond.
LONGEST_WAY = 0.3
#: The step found is such that one smaller by 1/FINER meets the bound too.
FINER = 10
#: Steps of the shortest run: a maximum over fewer of them says little.
LEAST_STEPS = 20
#: Step sizes that are tried are ``RESOLUTION`` times the time of a trial over an integer.
RESOLUTION = 10
MILLI = 1000


class Splitting(MolecularDynamics):  # type: ignore[misc]  # ASE has no types
    """Molecular dynamics at constant energy by a splitting method of kicks and drifts.

    A step evaluates as many forces as the method has stages. The last kick of a step and the first of the next share
    one: the calculator keeps it with its positions, as all calculators of ASE do, so a change of atoms, cell or momenta
    between two steps never meets an old force. The method sets the roles. A method that begins with a drift
    ends with one, and its last positions need no force: it costs one more force in each step whose forces an observer,
    a trajectory or a log asks for. The kinetic energy is quadratic, so Nystrom methods keep their order.

    Fixed atoms, coordinates, lines and planes are exact, as are Hookean restraints and external forces. Fixed bond
    lengths and other constraints raise an error: a drift along them is no straight line, and the order falls to 2.

    Forces that depend on velocities raise an error. The calculator is called with other momenta: three times before the
    first step, and once before steps 2, 3, 5, 9, 17, ... and before the last step of a run unless a comparison was
    near. After a drift each comparison evaluates the force at the momenta of the atoms as well.

    Parameters
    ----------
    atoms : ase.Atoms
        Atoms with a calculator. Atoms without momenta begin at rest.
    step : float
        Size of a whole step, above 0, in ASE's unit of time: ``5 * ase.units.fs``. The time of a force is
        ``step / stages``. ASE's name ``timestep`` is possible as well.
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
        atom that may move, a constraint that is not linear, or, from a run, forces that depend on velocities.

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
        self, atoms: Atoms, step: float | None = None, method: str | Tableau = "", *, trajectory: Any = None,
        logfile: Any = None, loginterval: int = 1, timestep: float | None = None, **more: Any,
    ) -> None:  # fmt: skip
        if not isinstance(atoms, Atoms):
            raise bad_setting("atoms", atoms, "an ase.Atoms")
        if step is not None and timestep is not None:
            raise bad_setting("timestep", timestep, "another name of step; give one of the two")
        self.method = method_for("ASE", method)
        given = step if timestep is None else timestep
        size = positive("step", given, "a time above 0 in ASE's unit, such as 5 * ase.units.fs")
        masses_of(atoms)
        check_constraints(atoms)
        super().__init__(atoms, size, trajectory=trajectory, logfile=logfile, loginterval=loginterval, **more)
        self.velocity_check, self._taken = VelocityCheck(), 0

    def step(self) -> None:
        """Take one step."""
        atoms = self.atoms
        check_constraints(atoms)
        masses = masses_of(atoms)
        self._compare_forces(masses)
        for move in self.method.flows:
            length = move.coefficient * self.dt
            if move.flow == "kick":
                atoms.set_momenta(atoms.get_momenta() + length * atoms.get_forces(md=True))
            else:
                atoms.set_positions(atoms.get_positions() + length * atoms.get_momenta() / masses)

    def _compare_forces(self, masses: np.ndarray) -> None:
        """Raise an error if the calculator is found to use velocities, which its cache does not know."""
        atoms, check, taken = self.atoms, self.velocity_check, self._taken
        self._taken += 1
        if not check.due(taken, last=self.nsteps + 1 == self.max_steps):
            return
        velocities = atoms.get_momenta() / masses

        def force(given: np.ndarray) -> np.ndarray:
            other = atoms.copy()
            other.arrays["momenta"] = given * masses
            other.calc = atoms.calc
            forget(other.calc)
            return np.asarray(other.get_forces(md=True))

        if check.finds(force, velocities, taken, atoms.get_forces(md=True)):
            raise SettingError("the forces of the calculator depend on velocities: a splitting method needs V(q)")

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


def forget(calculator: Any) -> None:
    """Let a calculator evaluate known positions again, and a sum of calculators its parts, as if atoms had moved.

    A reset would build neighbour lists anew, which changes the order of sums, and some calculators return nothing if
    nothing has changed.
    """
    for one in (calculator, *getattr(getattr(calculator, "mixer", None), "calcs", ())):
        if isinstance(one, BaseCalculator) and one.atoms is not None:
            one.atoms = one.atoms.copy()
            one.atoms.positions += 1


def positive(key: str, given: Any, allowed: str) -> float:
    """Return a finite number above 0 as a float; a user may pass anything."""
    if not is_real(given) or not (isfinite(given) and float(given) > 0):
        raise bad_setting(key, given, allowed)
    return float(given)


def masses_of(atoms: Atoms) -> np.ndarray:
    """Return the masses as a column, with 1 for fixed atoms, whose masses may be 0 and whose momenta are."""
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


#: Variables of a recommendation: their meanings and units.
COLUMNS = {
    "integrator": ("integrator, a name or the path of a file", "1"),
    "label": ("name in legends", "1"),
    "step": ("largest step size found that meets the bound", "fs"),
    "forces_per_step": ("forces evaluated in a step", "1"),
    "forces_per_picosecond": ("forces evaluated in a picosecond", "ps-1"),
    "max_energy_error": ("largest energy error per atom", "meV"),
}


def recommend(
    atoms: Atoms,
    error_per_atom: float,
    *,
    time: float = MILLI * units.fs,
    methods: Iterable[str | Tableau] = CANDIDATES,
    budget: int = 2000,
) -> xr.Dataset:
    """Rank methods by the forces that each takes on given atoms within an energy error.

    Each method runs from the positions and momenta of the atoms, with steps from large to small, until the energy at
    the end of every step of the trial differs from the first by at most the bound. A run that misses the bound ends at
    once. The largest step is found within 5 %, and a step smaller by 10 % meets the bound too. A trial sees the motions
    of its own time only: it should last for several periods of the slowest vibration. There are some ten runs for each
    method: the eight methods take about 5000 forces on copper at 0.01 meV per atom over 500 fs.

    Parameters
    ----------
    atoms : ase.Atoms
        Atoms with a calculator and with the momenta of the temperature of the run. They are not changed; the calculator
        evaluates copies of them and keeps the results of the last one.
    error_per_atom : float
        Bound of the energy error, above 0, in meV per atom.
    time : float
        Length of a trial, above 0, in ASE's unit of time; 1 ps by default. A run of large steps lasts for 20 of them.
    methods : iterable of str or Tableau
        Methods to choose from: names, paths of files, or tableaus, of plain kicks and drifts.
    budget : int
        Most forces of one trial run, at least 1.

    Returns
    -------
    xarray.Dataset
        Over ``rank``, 1 for the fewest forces: ``integrator``; ``label``; ``step`` in fs; ``forces_per_step``;
        ``forces_per_picosecond``; ``max_energy_error`` of the trial in meV per atom. Methods that miss the bound within
        the budget are left out: the attribute ``missed`` names them. The attribute ``call`` is the Python code of the
        first method, ``forces`` the number of forces of all trials.

    Raises
    ------
    NearharmonicError
        An unknown method, or a setting outside what is allowed, before any work; or no method meets the bound.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> import numpy as np
    >>> from ase.build import bulk
    >>> from ase.calculators.emt import EMT
    >>> atoms = bulk("Cu", cubic=True)
    >>> atoms.calc = EMT()
    >>> atoms.set_momenta(np.random.default_rng(1).normal(scale=1.5, size=(4, 3)))
    >>> found = nh.adapters.ase.recommend(atoms, 1.0, methods=["verlet", "bcss_s4"], time=20)
    >>> found.sizes["rank"]
    2
    """
    chosen = _methods(methods)
    bound = positive("error_per_atom", error_per_atom, "an energy above 0, in meV per atom") / MILLI
    duration = positive("time", time, "a time above 0 in ASE's unit, such as 1000 * ase.units.fs")
    most = _count(budget)
    _check(atoms)
    trial = Trial(atoms, duration, bound)
    rows, missed = [], []
    for i, (name, method) in enumerate(chosen.items(), 1):
        with trial.watched(f"{name} ({i} of {len(chosen)})"):
            best = _largest(trial, method, most)
        if best is None:
            missed.append(name)
            continue
        step, error = best
        cost = method.stages / step * MILLI * float(units.fs)
        rows.append((name, method.tableau.label, step / float(units.fs), method.stages, cost, error * MILLI))
    if not rows:
        raise RefusedError(
            f"no method of {', '.join(missed)} keeps the energy within {error_per_atom} meV per atom in "
            f"{budget} forces: give a larger error_per_atom or budget, or a shorter time; "
            f"rounding of the calculator is a limit too"
        )
    rows.sort(key=lambda row: row[4])
    name, _, step, *_ = rows[0]
    settings = {"error_per_atom": error_per_atom, "time": duration / float(units.fs), "budget": most}
    # The step of the call is rounded down to four digits: a smaller one meets the bound as well.
    unit = 10.0 ** (floor(log10(step)) - 3)
    call = f"nh.adapters.ase.Splitting(atoms, {floor(step / unit) * unit:.4g} * ase.units.fs, {name!r})"
    ranks = coordinate("rank", np.arange(1, len(rows) + 1), "rank by forces, 1 for the fewest")
    columns = zip(COLUMNS.items(), zip(*rows, strict=True), strict=True)
    variables = ranks | {key: variable("rank", values, *told) for (key, told), values in columns}
    found = {"forces": trial.forces, "missed": ", ".join(missed), "call": call}
    return assembled(variables, ["rank", "label"], settings | found)


class Trial:
    """Runs from one start, counted and shown by a bar; each has a copy of the atoms, and their calculator.

    ``duration`` is in ASE's unit of time, ``bound`` is the largest energy error in eV per atom.
    """

    def __init__(self, atoms: Atoms, duration: float, bound: float) -> None:
        self.atoms, self.duration, self.bound = atoms, duration, bound
        self.forces, self._velocity_check = 0, VelocityCheck()
        self._bar: Any = None
        self._first = self._energy(self._copy())
        self.longest = _longest_time(self._copy())

    def watched(self, name: str) -> Any:
        """Return a context in which a bar counts forces, on a terminal after two seconds."""
        from tqdm import tqdm

        self._bar = tqdm(desc=f"trying {name}", unit=" forces", delay=2, leave=False, disable=None)
        return self._bar

    def error(self, method: Method, step: float) -> float:
        """Return the largest energy error per atom of a run, or the first that misses the bound."""
        atoms, largest = self._copy(), 0.0
        begins_with_drift = method.first == "drift"
        self._count(not begins_with_drift)  # the first kick
        # The forces of a step that is much too large overflow, which is no fault of the calculator.
        with Splitting(atoms, step, method.tableau) as dynamics, np.errstate(all="ignore"):
            dynamics.velocity_check = self._velocity_check
            for _ in range(max(LEAST_STEPS, round(self.duration / step))):
                compared = self._velocity_check.compared
                try:
                    dynamics.step()
                    if not np.isfinite(atoms.positions).all():
                        return inf
                    error = abs(self._energy(atoms) - self._first)
                except (CalculatorError, ArithmeticError):  # positions after much too large a step
                    return inf
                # The energy after a last drift is one force more.
                self._count(method.stages + begins_with_drift + self._velocity_check.compared - compared)
                largest = max(largest, error) if isfinite(error) else inf
                if largest > self.bound:
                    break
        return largest

    def _count(self, forces: int) -> None:
        self.forces += forces
        self._bar.update(forces)

    def _copy(self) -> Atoms:
        atoms = self.atoms.copy()
        atoms.calc = self.atoms.calc
        atoms.set_momenta(atoms.get_momenta())  # those along constraints have no part in the energy
        return atoms

    @staticmethod
    def _energy(atoms: Atoms) -> float:
        """Return the energy per atom whose gradient the forces are: a smearing of electrons needs the free energy."""
        try:
            potential = atoms.get_potential_energy(force_consistent=True)
        except PropertyNotImplementedError:
            potential = atoms.get_potential_energy()
        return float(potential + atoms.get_kinetic_energy()) / len(atoms)


def _largest(trial: Trial, method: Method, budget: int) -> tuple[float, float] | None:
    """Return the largest step of a method that meets the bound, and its energy error in eV per atom."""
    errors: dict[int, float] = {}

    def step(parts: int) -> float:
        return trial.duration * RESOLUTION / parts

    def meets(parts: int) -> bool:
        errors[parts] = trial.error(method, step(parts))
        return errors[parts] <= trial.bound

    most = RESOLUTION * (budget // method.stages) if budget >= LEAST_STEPS * method.stages else 0
    parts: int | None = max(1, ceil(RESOLUTION * trial.duration / (trial.longest * method.stages)))
    while parts is not None:
        parts = fewest_steps(meets, parts, most)
        if parts is not None:
            finer = parts + max(1, parts // FINER)
            if finer > most or meets(finer):
                return step(parts), errors[parts]
            parts = finer + 1
    return None


def _longest_time(atoms: Atoms) -> float:
    """Return the time in which no atom moves by more than ``LONGEST_WAY`` under its first velocity and acceleration."""
    speeds = np.linalg.norm(atoms.get_momenta() / masses_of(atoms), axis=1)
    accelerations = np.linalg.norm(atoms.get_forces() / masses_of(atoms), axis=1)
    roots = np.sqrt(speeds**2 + 2 * accelerations * LONGEST_WAY)
    return float(2 * LONGEST_WAY / (speeds + roots).max())


def _methods(asked: Any) -> dict[str, Method]:
    """Return the methods by name or path; a user may pass anything."""
    names = list(asked) if isinstance(asked, Iterable) and not isinstance(asked, str | Tableau) else []
    if not names:
        raise bad_setting("methods", asked, "a list of at least one name, file path or Tableau")
    return {one.name if isinstance(one, Tableau) else str(one): method_for("ASE", one) for one in names}


def _count(budget: Any) -> int:
    if not is_real(budget) or not isinstance(budget, Integral) or int(budget) < 1:
        raise bad_setting("budget", budget, "an integer of at least 1")
    return int(budget)


def _check(atoms: Any) -> None:
    if not isinstance(atoms, Atoms):
        raise bad_setting("atoms", atoms, "an ase.Atoms")
    if atoms.calc is None:
        raise bad_setting("atoms", atoms, "atoms with a calculator, atoms.calc")
    masses_of(atoms)
    check_constraints(atoms)
    if not atoms.get_momenta().any():
        allowed = "atoms with momenta of the temperature of the run, with which a trial begins"
        raise bad_setting("atoms", atoms, allowed)
