"""Where a run begins: at values that the caller gives, or at the end of an earlier result."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from hashlib import sha256
from math import nan
from numbers import Rational
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.coefficients import Floats, moves_of
from nearharmonic.engine.initial_values import parameter_array, standard_parameters, start_array
from nearharmonic.engine.kernels import formulas_digest
from nearharmonic.engine.regularised import check_bound
from nearharmonic.engine.solution import Solution
from nearharmonic.errors import bad_setting

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.problem import Problem
    from nearharmonic.systems.system import System

#: Variables of a result that a continuation needs.
CONTINUED = ("q", "p", "t", "status", "diverged_at", "initial_energy", "initial_energy_low")


@dataclass(frozen=True, kw_only=True)
class Start:
    """Initial values of one run, as a kernel takes them.

    Attributes
    ----------
    state : (1, 4 d) array of float
        Position and momentum with the digits below them.
    parameters : (1, 2 P) array of float
        Parameters of the system, as pairs.
    system : System
        What is integrated.
    given : mapping
        Parameters in place of the system's own by name, as the caller gave them.
    t : float
        Time at which the run begins.
    reference : pair of float
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
    reference: tuple[float, float] = (nan, nan)
    running: Floats | None = None
    moves: str = ""

    def arrays(self, problem: Problem, steps: int) -> dict[str, Any]:
        """Arguments of :meth:`nearharmonic.engine.problem.Problem.run` for so many steps."""
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
        """What a Dataset says of it."""
        own = {name: parameter.value for name, parameter in self.system.parameters.items()}
        texts = own | {name: _exact_text(value) for name, value in self.given.items()}
        notes = {"parameters": json.dumps(texts)} if texts else {}
        notes["formulas"] = formulas_digest(self.system)
        return notes | ({"t_start": repr(self.t)} if self.t else {})


def moves_digest(problem: Problem, steps: int) -> str:
    """Return a digest of what moves a state in a run of so many steps: coefficients, step size and arithmetic."""
    numerics = problem.numerics
    rows = moves_of(problem.system, problem.tableau, [problem.end / steps], numerics)
    text = f"{numerics.precision} {numerics.compensated} {numerics.double_coefficients}"
    return sha256(text.encode() + rows.tobytes()).hexdigest()


def start_of(
    problem: Problem,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    start: xr.Dataset | Solution | None = None,
) -> Start:
    """Return where a run of ``problem`` begins; arguments as for :func:`nearharmonic.integrate`.

    Raises
    ------
    NearharmonicError
        A value outside what is allowed, or an earlier result that cannot be continued so.
    """
    if isinstance(start, Solution):
        start = start.to_dataset()
    earlier = {} if start is None else json.loads(_result(start).attrs.get("parameters", "{}"))
    asked = {**earlier, **_mapping(parameters)}
    rows = parameter_array(problem.system, asked) if asked else standard_parameters(problem.system)[None, :]
    if start is not None:
        if q0 is not None or p0 is not None:
            key, value = ("q0", q0) if q0 is not None else ("p0", p0)
            raise bad_setting(key, value, "with start=, a run continues from the state of that result")
        return _end_of(problem, start, rows, asked, changed=bool(parameters))
    state = start_array(problem.system, q0, p0, plain=problem.plain)
    for key, array in (("q0 and p0", state), ("parameters", rows)):
        if len(array) != 1:
            raise bad_setting(key, f"{len(array)} rows", "those of one trajectory; nearharmonic.ensemble takes many")
    check_bound(problem.system, state, rows)
    return Start(state=state, parameters=rows, system=problem.system, given=asked)


def _mapping(parameters: object) -> Mapping[str, Any]:
    if parameters is not None and not isinstance(parameters, Mapping):
        raise bad_setting("parameters", parameters, "a mapping of names to values")
    return parameters or {}


def _exact_text(value: Any) -> str:
    """A number that was accepted, in digits: those of its binary value if it is a float of any type."""
    if isinstance(value, str | Decimal | Rational):
        return str(value)
    if isinstance(value, Sequence):  # of one number
        return _exact_text(value[0])
    return str(Decimal(np.asarray(value, float).item()))


def _result(start: Any) -> Any:
    complete = hasattr(start, "attrs") and all(name in start for name in CONTINUED)
    if not complete or start.q.dims != ("sample", "component") or not start.q.size:
        allowed = "a Dataset that nearharmonic.integrate returned, with all its variables"
        raise bad_setting("start", type(start).__name__, allowed)
    return start


def _end_of(problem: Problem, start: Any, rows: Floats, given: Mapping[str, Any], *, changed: bool) -> Start:
    """The last sample of an earlier result."""
    system, last = problem.system, start.isel(sample=-1)
    if start.attrs.get("system") != system.name or last.q.size != system.dimension:
        raise bad_setting("start", f"a result of {start.attrs.get('system')}", f"a result of {system.name}")
    if start.attrs.get("formulas", formulas_digest(system)) != formulas_digest(system):
        what = f"a result of another system of the name {system.name}"
        raise bad_setting("start", what, "one of the same formulas, masses and parameters that are compiled in")
    if str(start.status.values) != "ok":
        raise bad_setting(
            "start", f"a run that diverged at step {int(start.diverged_at)}", "a run that did not diverge"
        )
    state = np.zeros((4, problem.states_dimension))
    for k, name in enumerate(("q", "q_low", "p", "p_low")):
        if name in last and not (problem.plain and k % 2):
            state[k, : system.dimension] = last[name].values
        clock = ("clock", "clock_low", "clock_momentum", "clock_momentum_low")[k]
        if clock in last and not (problem.plain and k % 2):
            state[k, system.dimension] = float(last[clock])
    reference = (nan, nan) if changed else (float(start.initial_energy), float(start.initial_energy_low))
    running = None
    if "running" in start and not changed:
        running = np.array(start.running.values, float)[None, :]
    return Start(
        state=state.reshape(1, -1), parameters=rows, system=system, given=given, t=float(last.t), reference=reference,
        running=running, moves=start.attrs.get("moves", ""),
    )  # fmt: skip
