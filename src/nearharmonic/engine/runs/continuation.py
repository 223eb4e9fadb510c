"""Start of a run: values that the caller gives, or the end of an earlier result.

A result keeps ``running``, the state of the last force, from which a continuation has the bits of one long run. It is
used only if the last sample is as the run left it, which a digest in the attribute ``end`` tells.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from math import nan
from numbers import Rational
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch.kernels import formulas_digest
from nearharmonic.engine.batch.regularised import check_bound
from nearharmonic.engine.numbers.arrays import array_of
from nearharmonic.engine.numbers.initial_values import parameter_array, standard_parameters, start_array
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import exact_value
from nearharmonic.output.dataset import Variables
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Variables of a result that a continuation needs.
CONTINUED = ("q", "p", "t", "status", "diverged_at", "initial_energy", "initial_energy_low")
#: Parts of a state, in the order of a kernel: of the coordinates, and of the time where V depends on it.
STATE = ("q", "q_low", "p", "p_low")
CLOCK = ("clock", "clock_low", "clock_momentum", "clock_momentum_low")


@dataclass(frozen=True, kw_only=True)
class Start:
    """Initial values of a run, or of M runs, as a kernel takes them.

    Attributes
    ----------
    state : (1 or M, 4 d) array of float
        Position and momentum with the digits below them.
    parameters : (1 or M, 2 P) array of float
        Parameters of the system, as pairs.
    system : System
        System of d coordinates.
    given : mapping
        Parameters in place of the system's own by name, as the caller gave them.
    t : float
        Time at which the run begins.
    reference : pair of float, or of (M,) array of float
        H0 that errors are relative to, NaN for that of the state.
    running : (1, 5 d) array of float, optional
        The state of the last force of an earlier result, from which steps with the same moves go on.
    moves : str
        Digest of these moves.
    """

    state: Floats
    parameters: Floats
    system: System
    given: Mapping[str, Any]
    t: float = 0.0
    reference: tuple[Any, Any] = (nan, nan)
    running: Floats | None = None
    moves: str = ""

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
    def constants(self) -> tuple[float, ...]:
        """The parameters as floats."""
        return tuple(self.parameters[0, ::2].tolist())

    def attributes(self) -> dict[str, str]:
        """Return its attributes for a Dataset."""
        notes = parameter_attributes(self.system, self.given) | {"formulas": formulas_digest(self.system)}
        over = "errors are over the steps, or the samples, behind t_start alone, and relative to H0 of the first run"
        return notes | ({"t_start": repr(self.t), "continued": over} if self.t else {})


def parameter_attributes(system: System, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the attribute ``parameters``: exact texts by name of those that all runs share, given or the system's own.

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
) -> Start:
    """Return where a run of ``problem`` begins; arguments as for :func:`nearharmonic.integrate`.

    Raises
    ------
    NearharmonicError
        A value outside what is allowed, or an earlier result that cannot be continued so.
    """
    if start is not None:
        if q0 is not None or p0 is not None:
            key, value = ("q0", q0) if q0 is not None else ("p0", p0)
            raise bad_setting(key, value, "with start=, a run continues from the state of that result")
        return _continued(problem, start, parameters)
    asked = _mapping(parameters)
    rows = parameter_array(problem.system, asked) if asked else standard_parameters(problem.system)[None, :]
    state = start_array(problem.system, q0, p0, plain=problem.plain)
    for key, array in (("q0 and p0", state), ("parameters", rows)):
        _check_one(key, array)
    check_bound(problem.system, state, rows)
    return Start(state=state, parameters=rows, system=problem.system, given=asked)


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
    kept = not own and "running" in start and _text(start, "end") == _end_digest_of(start)
    t = float(_last(start, "t", ()))
    check_bound(problem.system, state, rows)
    return Start(
        state=state, parameters=rows, system=problem.system, given=asked, t=t, moves=_text(start, "moves"),
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
        allowed = "those of a result, a mapping of names to decimals in JSON"
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
        raise bad_setting(key, f"{len(rows)} rows", "those of one trajectory; nearharmonic.ensemble takes many")


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


def _end_digest_of(start: xr.Dataset) -> str:
    variables: Variables = {
        str(name): (tuple(map(str, one.dims)), one.values, {}) for name, one in start.variables.items()
    }
    return end_digest(variables, start.attrs.get("parameters", ""))


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
