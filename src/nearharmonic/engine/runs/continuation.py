"""Start of a run: values that the caller gives, or the end of an earlier result."""

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

from nearharmonic.engine.batch.kernels import formulas_digest
from nearharmonic.engine.batch.regularised import check_bound
from nearharmonic.engine.numbers.coefficients import moves_of
from nearharmonic.engine.numbers.earlier_result import checked_result, end_of, parameters_of
from nearharmonic.engine.numbers.initial_values import parameter_array, standard_parameters, start_array
from nearharmonic.engine.runs.solution import Solution
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.runs.problem import Problem
    from nearharmonic.systems.definition.system import System


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
        """Arguments of :meth:`nearharmonic.engine.runs.problem.Problem.run` for so many steps."""
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
        return notes | ({"t_start": repr(self.t)} if self.t else {})


def parameter_attributes(system: System, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the attribute ``parameters``: exact texts by name of those that all runs share.

    Parameters
    ----------
    system : System
        Gives those that are not given.
    given : mapping
        Values by name that were accepted; arrays of several values, one a run, are left out.
    """
    values = {name: given.get(name, parameter.value) for name, parameter in system.parameters.items()}
    texts = {name: _exact_text(value) for name, value in values.items() if np.size(value) == 1}
    return {"parameters": json.dumps(texts)} if texts else {}


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
    if start is not None:
        if q0 is not None or p0 is not None:
            key, value = ("q0", q0) if q0 is not None else ("p0", p0)
            raise bad_setting(key, value, "with start=, a run continues from the state of that result")
        return _continued(problem, start.to_dataset() if isinstance(start, Solution) else start, parameters)
    asked = _mapping(parameters)
    rows = parameter_array(problem.system, asked) if asked else standard_parameters(problem.system)[None, :]
    state = start_array(problem.system, q0, p0, plain=problem.plain)
    for key, array in (("q0 and p0", state), ("parameters", rows)):
        _check_one(key, array)
    check_bound(problem.system, state, rows)
    return Start(state=state, parameters=rows, system=problem.system, given=asked)


def _continued(problem: Problem, start: Any, parameters: Mapping[str, Any] | None) -> Start:
    """The end of an earlier result, which keeps its H0 and ``running`` unless its parameters are replaced."""
    result = checked_result(problem, start)
    own = _mapping(parameters)
    asked = {**parameters_of(result), **own}
    rows = parameter_array(problem.system, asked)
    _check_one("parameters", rows)
    end = end_of(problem, result)
    check_bound(problem.system, end.state, rows)
    return Start(
        state=end.state, parameters=rows, system=problem.system, given=asked, t=end.t, moves=end.moves,
        reference=(nan, nan) if own else end.reference, running=None if own else end.running,
    )  # fmt: skip


def _check_one(key: str, rows: Floats) -> None:
    if len(rows) != 1:
        raise bad_setting(key, f"{len(rows)} rows", "those of one trajectory; nearharmonic.ensemble takes many")


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
