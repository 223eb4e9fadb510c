"""Validated description of runs: a system with its invariants, a method, how to integrate, and where a run starts."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from math import isfinite, nan
from numbers import Rational
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nearharmonic.engine import batch as batches
from nearharmonic.engine import settings
from nearharmonic.engine.kernels import check_precision, cost_of, energy_floor, formulas_digest
from nearharmonic.engine.numbers import (
    array_of,
    exact,
    moves_of,
    parameter_array,
    parameters_at_run_time,
    standard_parameters,
    standard_start,
    start_array,
)
from nearharmonic.errors import SystemDefinitionError, bad_setting, warn_caller
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import OneStepMethod, Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.numerics.written import exact_value
from nearharmonic.output.store import Variables, variables_of
from nearharmonic.systems import systems
from nearharmonic.systems.gradients import check_oscillator
from nearharmonic.systems.numba_potential import numba_potential
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


# --- Invariants and observables of a system: their values at states.
def energy_at_start(system: System) -> float:
    """Return H at the system's own start, in double precision; it is finite, or an error."""
    q, p = system.start(float)
    try:
        H0 = float(system.energy(q, p, system.constants(float), 0.0))
    except (ArithmeticError, ValueError):
        H0 = float("nan")
    if not isfinite(H0):
        raise bad_setting("(q0, p0)", f"({list(q)}, {list(p)})", f"a start where the energy of {system.name} is finite")
    return H0


def invariant_values(
    system: System, q: ArrayLike, p: ArrayLike, constants: Sequence[Any] | None = None
) -> dict[str, Floats]:
    """Return the invariants of ``system`` at states ``q``, ``p`` (..., d) as arrays (..., components), by name.

    They are evaluated in double precision, with the system's own parameters by default.
    """
    given = system.constants(float) if constants is None else constants
    states = np.asarray(q, float), np.asarray(p, float)
    return {
        name: _evaluated(f"{system.name}: the invariant {name}", function, *states, given)
        for name, function in system.invariants.items()
    }


def _evaluated(what: str, function: Callable[..., Any], q: Floats, p: Floats, constants: Sequence[Any]) -> Floats:
    """The components (..., k) of a function at states (..., d); NaN where it fails, unless it fails everywhere."""
    shape = q.shape[:-1]

    def components(q: Any, p: Any, constants: Sequence[Any], shape: tuple[int, ...]) -> Floats:
        with np.errstate(all="ignore"):  # a state may be too large for it
            value = function(tuple(q), tuple(p), *constants)
        parts = value if isinstance(value, tuple | list) else (value,)
        found = np.empty((*shape, len(parts)))
        for i, part in enumerate(parts):
            if part is None or np.iscomplexobj(part):
                raise TypeError(f"it returns an object of type {type(part).__name__}, expected real numbers")
            found[..., i] = part
        return found

    try:
        return components(np.moveaxis(q, -1, 0), np.moveaxis(p, -1, 0), constants, shape)
    except Exception as error:
        rows = {}
        for place in np.ndindex(shape) if np.prod(shape) > 1 else ():
            with suppress(Exception):  # as it may far from the start
                given = [np.broadcast_to(x, shape)[place] for x in constants]
                rows[place] = components(q[place], p[place], given, ())
        if not rows:
            raise SystemDefinitionError(f"{what} cannot be evaluated: {type(error).__name__}: {error}") from error
    found = np.full((*shape, len(next(iter(rows.values())))), np.nan)
    for place, row in rows.items():
        found[place] = row
    return found


@remembered
def check_quantities(system: System) -> None:
    """Evaluate invariants and observables at the start, so that faulty formulas fail before any work."""
    q, p = (np.array([row]) for row in system.start(float))
    invariant_values(system, q, p)
    observable_values(system, q, p, system.constants(float))


def observable_values(system: System, q: Floats, p: Floats, constants: Sequence[Any]) -> dict[str, Floats]:
    """Return the observables of ``system`` at states ``q``, ``p`` (..., d) as arrays (...), by name."""
    return {
        name: _evaluated(f"{system.name}: the observable {name}", observable.function, q, p, constants)[..., 0]
        for name, observable in system.observables.items()
    }


# --- Validated description of runs: a system, a method, and how to integrate.

#: Relative difference between the steps that are asked for and that run, from which on a user is warned.
WARNED = 0.01
#: Bytes of results that one call keeps at most.
MOST_BYTES = 8_000_000_000
#: A method that fits every system, for checks of the system alone.
ANY = "ruth"


def as_python(system: str | os.PathLike[str] | System) -> str:
    """Return Python code of a system: the literal of its name or path, or the name of its object."""
    return system.name if isinstance(system, System) else repr(os.fspath(system))


class Setup:
    """Validated description of runs: a system, a method, and how to integrate; arguments as for
    :func:`nearharmonic.integrate`.

    ``system`` has d coordinates, ``tableau`` is the method in the role that is used, and ``t_end`` the end of the
    interval [0, t_end] as a decimal string, negative to run backwards. ``numerics`` has the arithmetic, the times at
    which the energy is measured, and the split of H. Errors are relative to the energy ``scale``; 0 for |H0|, or for
    the unit of energy where H0 = 0. ``samples`` are the most states that a run keeps.
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
        split: str = settings.KINETIC_POTENTIAL,
        samples: int = 2,
    ) -> None:
        self.system = (system if isinstance(system, System) else systems[system]).refresh()
        tableau = integrator if isinstance(integrator, OneStepMethod) else integrators[integrator]
        role = None if first is None else settings.one_of("first", first, settings.OPERATORS)
        self.tableau = tableau.role(role)  # type: ignore[arg-type]
        settings.check_fit(self.system, self.tableau, split)
        check_quantities(self.system)
        batches.check_bound(
            self.system, standard_start(self.system, False)[None, :], standard_parameters(self.system)[None, :]
        )
        self.t_end = settings.checked_t_end(self.system.t_end if t_end is None else t_end)
        self.end = settings.exact_decimal(self.t_end)
        if self.tableau.processed and energy == "every":  # states between samples are not processed
            energy = "samples"
        self.numerics = settings.Numerics(precision=precision, summation=summation, energy=energy, split=split)
        check_precision(self.system, [precision])
        if self.tableau.implicit and precision == "extended" and self.system.formulas().are_loops:
            what = f"{self.tableau.name} has only double precision for formulas compiled as loops, such as"
            raise bad_setting("precision", precision, f"{what} {self.system.name}")
        if self.numerics.exact_oscillator:
            check_oscillator(self.system)
        asked_scale = self.system.energy_scale if energy_scale is None else energy_scale
        self.scale = self.system.typical_energy if asked_scale is None else checked_scale(asked_scale)
        self.samples = settings.checked_samples(samples)

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
        return settings.steps_of(self.t_end.lstrip("-"), settings.checked_tau(tau, key), key)

    def taus(self, steps: Integers) -> Floats:
        """Return the step sizes as used, rounded once."""
        return np.array([self.end.numerator / (self.end.denominator * n) for n in steps.tolist()])

    def moves(self, taus: Sequence[Fraction]) -> Floats:
        """Return the moves of these step sizes, as :func:`nearharmonic.engine.numbers.moves_of` does."""
        return moves_of(self.system, self.tableau, taus, self.numerics)

    def batch(
        self, moves: Floats, marks: Integers, scheme: Integers, start: Floats, parameters: Floats,
        numerics: settings.Numerics | None = None,
    ) -> batches.Batch:  # fmt: skip
        """Return a batch of arrays that :class:`nearharmonic.engine.batch.Batch` describes, ready to run.

        Arithmetic and lanes are its own, or others.
        """
        return batches.prepared_batch(
            self.system, self.tableau, numerics or self.numerics, moves=moves, marks=marks, scheme=scheme, start=start,
            parameters=parameters, scale=self.scale,
        )  # fmt: skip

    def run(self, steps: Sequence[int], samples: int, **given: Any) -> batches.Trajectories:
        """Integrate one run for each entry of ``steps``; those that are equal in all are computed once.

        What is ``given`` further is as for :func:`nearharmonic.engine.batch.integrate_batch`.
        """
        alike = (given.get(name) for name in ("start", "parameters"))
        same = given.get("marks") is None and all(rows is None or len(rows) == 1 for rows in alike)
        distinct = list(dict.fromkeys(steps)) if same else list(steps)
        paths = batches.integrate_batch(
            self.system, self.tableau, t_end=self.end, steps=distinct, samples=samples, numerics=self.numerics,
            scale=self.scale, **given,
        )  # fmt: skip
        if len(distinct) == len(steps):
            return paths
        where = {n: i for i, n in enumerate(distinct)}
        return paths.take(np.array([where[n] for n in steps]))

    def trajectories(self, steps: Integers, arrays: batches.Filled) -> batches.Trajectories:
        """Return the results of runs of so many steps (R,) by name."""
        return batches.trajectories_of(self.system, self.tableau, steps, arrays, self.numerics, self.scale)

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


def asked_steps(problem: Setup, tau: object) -> tuple[int, float]:
    """Return the steps of a step size, and the step size that was asked for; warn the caller if the two do not fit."""
    steps, asked = problem.steps_of(tau), settings.checked_tau(tau)
    warn_of_step(problem, [asked], [steps], above=3)
    return steps, asked


def warn_of_step(
    problem: Setup, asked: Sequence[float], steps: Sequence[int], key: str = "tau", above: int = 2
) -> None:
    """Warn the caller of a public function of a step that is 1 % off the one that was asked for, or more.

    The caller is so many frames ``above``. This package itself asks for steps in the knowledge of what runs, and is not
    warned.
    """
    used = [abs(float(problem.end)) / n for n in steps]
    off = [abs(size / tau - 1) for size, tau in zip(used, asked, strict=True)]
    i = max(range(len(off)), key=off.__getitem__)
    while (caller := sys._getframe(above).f_globals.get("__name__", "")) == "nearharmonic.errors":
        above += 1  # a public function is wrapped by naming_arguments
    if off[i] < WARNED or caller.startswith("nearharmonic"):
        return
    name = key if key == "tau" else f"{key}[{i}]"
    message = f"{name} = {asked[i]:.6g} runs as {used[i]:.6g}: t_end = {problem.t_end} is no multiple of it"
    warn_caller(f"{message}, and is covered by {steps[i]} equal steps")


def check_memory(what: str, numbers: int, samples: int) -> None:
    """Raise an error for more than :data:`MOST_BYTES` of results."""
    if (size := 8 * numbers) > MOST_BYTES:
        raise bad_setting("samples", samples, f"{what} would take {size:.1e} bytes, and a call keeps {MOST_BYTES:.0e}")


def checked_scale(value: object) -> float:
    """Return the energy that errors are relative to, a finite number above 0; 0 for None."""
    if value is None:
        return 0.0
    scale = float(exact("energy_scale", value))
    if not scale > 0:
        raise bad_setting("energy_scale", value, "a finite number above 0, in the unit of energy")
    return scale


# --- Start of a run: values that the caller gives, or the end of an earlier result.
#
# A result keeps ``running``, the state of the last force, from which a continuation has the bits of one long run. It is
# used only if the last sample is as the run left it, which a digest in the attribute ``end`` tells.

#: Variables of a result that a continuation needs.
CONTINUED = ("q", "p", "t", "status", "diverged_at", "initial_energy", "initial_energy_low")
#: Parts of a state, in the order of a kernel: of the coordinates, and of the time where V depends on it.
STATE = ("q", "q_low", "p", "p_low")
CLOCK = ("clock", "clock_low", "clock_momentum", "clock_momentum_low")


@dataclass(frozen=True, kw_only=True)
class Start:
    """Initial values of a run, or of M runs, as a kernel takes them.

    ``state`` (1 or M, 4 d): position and momentum with the digits below them. ``parameters`` (1 or M, 2 P), as pairs.
    ``given``: parameters in place of the system's own by name, as the caller gave them. ``t``: time at which the run
    begins. ``reference``: H0 that errors are relative to, a pair of numbers or of arrays (M,), NaN for the energy of
    the state. ``running`` (1, 5 d): the state of the last force of an earlier result, from which steps with the same
    ``moves``, their digest, go on.
    """

    state: Floats
    parameters: Floats
    system: System
    given: Mapping[str, Any]
    t: float = 0.0
    reference: tuple[Any, Any] = (nan, nan)
    running: Floats | None = None
    moves: str = ""

    @property
    def members(self) -> int:
        """Number of runs."""
        return max(len(self.state), len(self.parameters))

    def arrays(self, problem: Setup, steps: int) -> dict[str, Any]:
        """Arguments of :meth:`Setup.run` for so many steps."""
        same = self.running is not None and moves_digest(problem, steps) == self.moves
        return {
            "start": self.state,
            "parameters": self.parameters,
            "reference": self.reference,
            "resumed": self.running if same else None,
        }

    @property
    def constants(self) -> list[Any]:
        """The parameters as floats, or as arrays (M, 1)."""
        return self.parameters[0, ::2].tolist() if len(self.parameters) == 1 else [*self.parameters.T[::2, :, None]]

    def attributes(self) -> dict[str, str]:
        """Return its attributes for a Dataset."""
        notes = parameter_attributes(self.system, self.given) | {"formulas": formulas_digest(self.system)}
        over = "errors are over the steps, or the samples, behind t_start alone, and relative to H0 of the first run"
        return notes | ({"t_start": repr(self.t), "continued": over} if self.t else {})


def parameter_attributes(system: System, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the attribute ``parameters``: exact texts by name of the parameters that all runs share.

    Arrays of several values, one a run, are left out.
    """
    values = {name: given.get(name, parameter.value) for name, parameter in system.parameters.items()}
    texts = {name: _exact_text(value) for name, value in values.items() if np.size(value) == 1}
    return {"parameters": json.dumps(texts)} if texts else {}


def moves_digest(problem: Setup, steps: int) -> str:
    """Return a digest of the moves of a run of so many steps: coefficients, step size and arithmetic."""
    numerics = problem.numerics
    text = f"{numerics.precision} {numerics.compensated} {numerics.double_coefficients}"
    if problem.tableau.implicit:  # its moves are the step size alone
        text += f" {problem.tableau.digest()}"
    return sha256(text.encode() + problem.moves([problem.end / steps]).tobytes()).hexdigest()


def end_digest(variables: Variables, parameters: str) -> str:
    """Return a digest of the last sample of a result, of its ``running``, and of its parameters as text."""
    found = sha256(parameters.encode())
    for name in (*STATE, *CLOCK, "running"):
        if name in variables:
            values = np.asarray(variables[name][1])
            found.update(f" {name} {values.dtype.str} ".encode())
            found.update(values.tobytes() if name == "running" else values[-1:].tobytes())
    return found.hexdigest()


def start_of(
    problem: Setup,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    start: xr.Dataset | None = None,
    *,
    several: bool = False,
) -> Start:
    """Return where a run of ``problem`` begins, or where ``several`` members do.

    The other arguments are as for :func:`nearharmonic.integrate` and :func:`nearharmonic.ensemble`.
    """
    if start is None:
        asked = _mapping(parameters)
        rows = parameter_array(problem.system, asked) if asked else standard_parameters(problem.system)[None, :]
        state = start_array(problem.system, q0, p0, plain=problem.plain)
        begin = Start(state=state, parameters=rows, system=problem.system, given=asked)
    elif q0 is not None or p0 is not None:
        key, value = ("q0", q0) if q0 is not None else ("p0", p0)
        raise bad_setting(key, value, "with start=, a run continues from the state of that result")
    elif several and "member" in getattr(start, "dims", ()):
        members = [_continued(problem, start.isel(member=i), parameters) for i in range(start.sizes["member"])]
        if not members:
            raise bad_setting("start", "a Dataset without members", "a result of one member or more")
        begin = _joined(members)
    else:
        begin = _continued(problem, start, parameters)
    for key, array in (("q0 and p0", begin.state), ("parameters", begin.parameters)):
        if not several:
            _check_one(key, array)
        elif len(array) not in (1, begin.members):
            raise bad_setting(key, f"{len(array)} rows", f"one row, or one for each of {begin.members} members")
    batches.check_bound(problem.system, begin.state, begin.parameters)
    if several:
        parameters_at_run_time(problem.system, problem.numerics, begin.parameters)
    return begin


def _joined(begins: Sequence[Start]) -> Start:
    """Return the starts of several members as one, with one row of parameters if they are equal."""
    rows, given = np.concatenate([begin.parameters for begin in begins]), begins[0].given
    if (rows == rows[0]).all():
        rows = rows[:1]
    else:
        given = {name: [begin.given[name] for begin in begins] for name in given}
    reference = tuple(np.array([begin.reference for begin in begins]).T)
    state = np.concatenate([begin.state for begin in begins])
    return replace(begins[0], state=state, parameters=rows, given=given, reference=reference)


def members_are_given(q0: Any, p0: Any, parameters: Mapping[str, Any] | None, start: Any = None) -> bool:
    """Return True if initial values have rows, or a parameter has several values: results then have members."""
    rows = any(np.ndim(x) == 2 for x in (q0, p0) if x is not None) or "member" in getattr(start, "dims", ())
    return rows or any(map(np.ndim, (parameters or {}).values()))


def _continued(problem: Setup, given: object, parameters: Mapping[str, Any] | None) -> Start:
    """The end of an earlier result, which keeps its H0 and ``running`` unless its parameters are replaced."""
    start = _checked(problem, given)
    own = _mapping(parameters)
    asked = {**_parameters_of(start, problem.system), **own}
    rows = parameter_array(problem.system, asked)
    _check_one("parameters", rows)
    state = _last_state(problem, start)
    reference = nan, nan
    if not own and _text(start, "energy") != "none":
        reference = _number(start["initial_energy"]), _number(start["initial_energy_low"])
    kept = (
        not own
        and "running" in start
        and _text(start, "end") == end_digest(variables_of(start), start.attrs.get("parameters", ""))
    )
    return Start(
        state=state, parameters=rows, system=problem.system, given=asked, t=float(_last(start, "t", ())),
        moves=_text(start, "moves"),
        reference=reference, running=start.running.values[None, :].copy() if kept else None,
    )  # fmt: skip


def _last_state(problem: Setup, start: xr.Dataset) -> Floats:
    """The state (1, 4 D) of the last sample, with the digits below it; of plain sums only the clock has them."""
    d, state = problem.system.dimension, np.zeros((4, problem.states_dimension))
    for k, (name, clock) in enumerate(zip(STATE, CLOCK, strict=True)):
        below = k % 2 and problem.plain
        if name in start and not below:
            state[k, :d] = _last(start, name, (d,))
        if clock in start and problem.system.time_dependent and not (below and clock != "clock_low"):
            state[k, d] = _last(start, clock, ())
    return state.reshape(1, -1)


def _checked(problem: Setup, given: Any) -> xr.Dataset:
    """Return ``given``, if it is a result of the system of ``problem`` that did not diverge."""
    import xarray as xr

    allowed = "a Dataset that nearharmonic.integrate returned, or a member of an ensemble, with all its variables"
    if not isinstance(given, xr.Dataset):
        raise bad_setting("start", type(given).__name__, allowed)
    system = problem.system
    start: xr.Dataset = given.transpose("sample", ..., missing_dims="ignore")
    missing = [name for name in (*CONTINUED, *CLOCK * system.time_dependent) if name not in start]
    if missing or start.q.dims != ("sample", "component") or not start.q.size:
        what = f"without {', '.join(missing)}" if missing else f"whose q has {dict(start.q.sizes)}"
        raise bad_setting("start", f"a Dataset {what}", allowed)
    if _text(start, "system") != system.name or start.q.shape[1] != system.dimension:
        raise bad_setting("start", f"a result of {start.attrs.get('system')}", f"a result of {system.name}")
    if _text(start, "formulas") != formulas_digest(system):
        what = f"a result of another system of the name {system.name}"
        what = what if "formulas" in start.attrs else "a result without its attribute formulas"
        raise bad_setting("start", what, "one of the same formulas, masses and parameters that are compiled in")
    if str(start.status.values) != "ok":
        what = f"a run that diverged at step {start.diverged_at.values}"
        raise bad_setting("start", what, "a run that did not diverge")
    return start


def _parameters_of(start: xr.Dataset, system: System) -> Mapping[str, Any]:
    """Return the parameters of a result by name: exact texts, or exact numbers for coordinates of an ensemble."""
    text = start.attrs.get("parameters", "{}")
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        allowed = "the parameters of a result, a mapping of names to decimals in JSON"
        raise bad_setting("start.attrs['parameters']", text, allowed)
    for i, name in enumerate(system.parameters):
        if name in found:
            continue
        if f"parameter_{name}" not in start or start.get("parameters_low", start.q).dims != ("parameter",):
            allowed = "as many.isel(member=i) of an ensemble leaves it, without drop=True"
            raise bad_setting("start", f"a Dataset without parameter_{name} or parameters_low", allowed)
        parts = start[f"parameter_{name}"], start["parameters_low"][i]
        found[name] = sum(Fraction(_number(part)) for part in parts)
    return found


def _check_one(key: str, rows: Floats) -> None:
    if len(rows) != 1:
        raise bad_setting(key, f"{len(rows)} rows", "one row, for one trajectory; nearharmonic.ensemble takes many")


def _mapping(parameters: object) -> Mapping[str, Any]:
    if parameters is not None and not isinstance(parameters, Mapping):
        raise bad_setting("parameters", parameters, "a mapping of names to values")
    return parameters or {}


def _exact_text(value: Any) -> str:
    """Return the digits of a valid number; a float of any type gives its binary value."""
    if not isinstance(value, str | Decimal | Rational):
        value = np.ravel(value)[0]  # of one number
    if isinstance(value, str | Decimal | Rational):
        return str(value)
    number = exact_value(value)
    return str(Decimal(float(number)) if number == float(number) else number)


def _text(start: xr.Dataset, name: str) -> str:
    """An attribute, or nothing where it is no text."""
    value = start.attrs.get(name)
    return value if isinstance(value, str) else ""


def _last(start: xr.Dataset, name: str, shape: tuple[int, ...]) -> Floats:
    """The last sample of a variable, of so many finite numbers."""
    one = start[name]
    values = _doubles(f"start.{name}", one) if one.dims[:1] == ("sample",) else None
    if values is None or values.shape[1:] != shape:
        what = f"{one.dtype} of shape {one.shape} over {' and '.join(map(str, one.dims)) or 'nothing'}"
        allowed = f"float64 of shape {(start.sizes['sample'], *shape)} over the samples"
        raise bad_setting(f"start.{name}", what, allowed)
    if not np.isfinite(values[-1]).all():
        raise bad_setting(f"start.{name}[-1]", values[-1].tolist(), "finite numbers, from which a run goes on")
    found: Floats = values[-1].astype(float)
    return found


def _number(one: xr.DataArray) -> float:
    """The finite number that a variable without dimensions holds."""
    values = _doubles(f"start.{one.name}", one)
    if values is None or values.ndim or not np.isfinite(values):
        raise bad_setting(f"start.{one.name}", one.values.tolist(), "a finite number, in float64")
    return float(values)


def _doubles(key: str, one: xr.DataArray) -> Any:
    """The values of a variable, or None if they are no numbers, or floats of another precision than the run left."""
    values = array_of(key, one.values)
    return None if values is None or (values.dtype.kind == "f" and values.dtype != np.float64) else values
