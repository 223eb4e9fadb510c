"""Validated description of runs: a system, a method, and how to integrate."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from fractions import Fraction
from math import nan

import numpy as np

from nearharmonic.engine.batch.batch import integrate_batch, prepared_batch
from nearharmonic.engine.batch.kernels import cost_of
from nearharmonic.engine.batch.numba_runs import check_precision, energy_floor
from nearharmonic.engine.batch.queue import Batch
from nearharmonic.engine.batch.regularised import check_bound
from nearharmonic.engine.batch.results import Filled, Trajectories, trajectories_of
from nearharmonic.engine.grid import check_fit, steps_of
from nearharmonic.engine.numbers.arrays import exact
from nearharmonic.engine.numbers.coefficients import moves_of
from nearharmonic.engine.numbers.initial_values import standard_parameters, standard_start
from nearharmonic.engine.runs.invariants import check_quantities
from nearharmonic.engine.settings import (
    KINETIC_POTENTIAL,
    OPERATORS,
    Numerics,
    checked_samples,
    checked_t_end,
    checked_tau,
    exact_decimal,
    one_of,
)
from nearharmonic.errors import bad_setting, warn_caller
from nearharmonic.integrators import integrators
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats, Integers
from nearharmonic.systems import systems
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import check_oscillator
from nearharmonic.systems.numba.potential import numba_potential

#: Relative difference between the steps that are asked for and that run, from which on a user is warned.
WARNED = 0.01
#: A method that fits every system, for checks of the system alone.
ANY = "ruth"


def as_python(system: str | os.PathLike[str] | System) -> str:
    """Return Python code of a system: the literal of its name or path, or the name of its object."""
    return system.name if isinstance(system, System) else repr(os.fspath(system))


class Setup:
    """Validated description of runs: a system, a method, and how to integrate.

    Parameters
    ----------
    system, integrator, precision, summation, first, energy, t_end, energy_scale, split
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a run keeps, by default the first and the last.

    Attributes
    ----------
    system : System
        System of d coordinates.
    tableau : Tableau
        The method, in the role that is used.
    t_end : str
        End of the interval [0, t_end], a decimal string; negative to run backwards.
    numerics : Numerics
        Arithmetic, times at which the energy is measured, and the split of H.
    scale : float
        Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.
    """

    def __init__(
        self,
        system: str | System,
        integrator: str | Tableau,
        *,
        precision: str = "double",
        summation: str = "compensated",
        first: str | None = None,
        energy: str = "every",
        t_end: float | str | None = None,
        energy_scale: float | str | None = None,
        split: str = KINETIC_POTENTIAL,
        samples: int = 2,
    ) -> None:
        self.system = (system if isinstance(system, System) else systems[system]).refresh()
        tableau = integrator if isinstance(integrator, Composition) else integrators[integrator]
        role = None if first is None else one_of("first", first, OPERATORS)
        self.tableau = tableau.role(role)  # type: ignore[arg-type]
        check_fit(self.system, self.tableau, split)
        check_quantities(self.system)
        check_bound(self.system, standard_start(self.system, False)[None, :], standard_parameters(self.system)[None, :])
        self.t_end = checked_t_end(self.system.t_end if t_end is None else t_end)
        self.end = exact_decimal(self.t_end)
        if self.tableau.processed and energy == "every":  # the states between samples are not those of the method
            energy = "samples"
        self.numerics = Numerics(precision=precision, summation=summation, energy=energy, split=split)
        check_precision(self.system, [precision])
        if self.tableau.implicit and precision == "extended" and self.system.formulas().are_loops:
            what = f"{self.tableau.name} has double precision for formulas that are compiled as loops, as those of"
            raise bad_setting("precision", precision, f"{what} {self.system.name}")
        if self.numerics.exact_oscillator:
            check_oscillator(self.system)
        asked_scale = self.system.energy_scale if energy_scale is None else energy_scale
        self.scale = self.system.typical_energy if asked_scale is None else checked_scale(asked_scale)
        self.samples = checked_samples(samples)

    @property
    def plain(self) -> bool:
        """True if the digits below a double are dropped."""
        return not self.numerics.compensated

    @property
    def states_dimension(self) -> int:
        """Coordinates of the states that are kept: the system's own, and the time if V depends on it."""
        return self.system.dimension + self.system.time_dependent

    @property
    def cost(self) -> int:
        """Cost of a step, in units of a few nanoseconds at most."""
        tableau = self.tableau
        return tableau.stages * cost_of(self.system, self.numerics.compiled, **tableau.kernel_options)

    def steps_of(self, tau: object, key: str = "tau") -> int:
        """Return max(1, round(|t_end| / tau))."""
        return steps_of(self.t_end.lstrip("-"), checked_tau(tau, key), key)

    def taus(self, steps: Integers) -> Floats:
        """Return the step sizes as used, rounded once."""
        return np.array([self.end.numerator / (self.end.denominator * n) for n in steps.tolist()])

    def moves(self, taus: Sequence[Fraction]) -> Floats:
        """Return the moves of these step sizes, as :func:`nearharmonic.engine.numbers.coefficients.moves_of` does."""
        return moves_of(self.system, self.tableau, taus, self.numerics)

    def batch(
        self, moves: Floats, marks: Integers, scheme: Integers, start: Floats, parameters: Floats,
        numerics: Numerics | None = None,
    ) -> Batch:  # fmt: skip
        """Return a batch that is ready to run.

        Parameters
        ----------
        moves, marks, scheme, start, parameters
            Arrays that :class:`Batch` describes.
        numerics : Numerics, optional
            Arithmetic and lanes in place of its own.
        """
        return prepared_batch(
            self.system, self.tableau, numerics or self.numerics, moves=moves, marks=marks, scheme=scheme, start=start,
            parameters=parameters, scale=self.scale,
        )  # fmt: skip

    def run(
        self,
        steps: Sequence[int],
        samples: int,
        *,
        start: Floats | None = None,
        parameters: Floats | None = None,
        marks: Integers | None = None,
        reference: tuple[float, float] = (nan, nan),
        resumed: Floats | None = None,
    ) -> Trajectories:
        """Integrate one run for each entry of ``steps``; those that are equal in all are computed once.

        Parameters
        ----------
        steps : (R,) sequence of int
            Steps of each run.
        samples : int
            Most samples of a run.
        start, parameters, marks, reference, resumed
            As for :func:`nearharmonic.engine.batch.batch.integrate_batch`.
        """
        same = marks is None and all(rows is None or len(rows) == 1 for rows in (start, parameters))
        distinct = list(dict.fromkeys(steps)) if same else list(steps)
        paths = integrate_batch(
            self.system, self.tableau, t_end=self.end, steps=distinct, samples=samples, numerics=self.numerics,
            start=start, parameters=parameters, marks=marks, scale=self.scale, reference=reference, resumed=resumed,
        )  # fmt: skip
        if len(distinct) == len(steps):
            return paths
        where = {n: i for i, n in enumerate(distinct)}
        return paths.take(np.array([where[n] for n in steps]))

    def trajectories(self, steps: Integers, arrays: Filled) -> Trajectories:
        """Return the results of runs of so many steps (R,) by name."""
        return trajectories_of(self.system, self.tableau, steps, arrays, self.numerics, self.scale)

    def floor(self, start: Floats, parameters: Floats, H0: Floats) -> dict[str, float]:
        """Return the attribute ``energy_floor``, if energies are measured; arguments as for :func:`energy_floor`."""
        if self.numerics.energy == "none":
            return {}
        return energy_floor(self.system, self.scale, start, parameters, H0)

    def standard_floor(self) -> dict[str, float]:
        """Return the attribute ``energy_floor`` of runs from the system's own start with its own parameters."""
        if numba_potential(self.system) is None:
            return {}
        start, parameters = standard_start(self.system, self.plain), standard_parameters(self.system)
        H0 = np.array([self.system.energy(*self.system.start(float), self.system.constants(float))])
        return self.floor(start[None, :], parameters[None, :], H0)


def warn_of_step(problem: Setup, asked: Sequence[float], steps: Sequence[int], key: str = "tau") -> None:
    """Warn the caller of a public function of a step that is 1 % off the one that was asked for, or more.

    This package itself asks for steps in the knowledge of what runs, and is not warned.
    """
    used = [abs(float(problem.end)) / n for n in steps]
    off = [abs(size / tau - 1) for size, tau in zip(used, asked, strict=True)]
    i = max(range(len(off)), key=off.__getitem__)
    above = 2
    while (caller := sys._getframe(above).f_globals.get("__name__", "")) == "nearharmonic.errors":
        above += 1  # a public function is wrapped by naming_arguments
    if off[i] < WARNED or caller.split(".")[0] == "nearharmonic":
        return
    name = key if key == "tau" else f"{key}[{i}]"
    message = f"{name} = {asked[i]:.6g} runs as {used[i]:.6g}: t_end = {problem.t_end} is no multiple of it"
    warn_caller(f"{message}, and is covered by {steps[i]} equal steps")


def checked_scale(value: object) -> float:
    """Return the energy that errors are relative to; 0 for None.

    Raises
    ------
    SettingError
        Not a finite number above 0.
    """
    if value is None:
        return 0.0
    scale = float(exact("energy_scale", value))
    if not scale > 0:
        raise bad_setting("energy_scale", value, "a finite number above 0, in the unit of energy")
    return scale
