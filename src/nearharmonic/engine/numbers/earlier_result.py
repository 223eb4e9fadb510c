"""The end of an earlier result, read and validated: the state that a run goes on from.

A result keeps ``running``, the state of the last force, from which a continuation has the bits of one long run. It is
used only if the last sample is as the run left it, which a digest in the attribute ``end`` tells.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch.kernels import formulas_digest
from nearharmonic.engine.numbers.arrays import array_of
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.output.dataset import Variables

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.runs.problem import Problem

#: Variables of a result that a continuation needs.
CONTINUED = ("q", "p", "t", "status", "diverged_at", "initial_energy", "initial_energy_low")
#: Parts of a state, in the order of a kernel: of the coordinates, and of the time where V depends on it.
STATE = ("q", "q_low", "p", "p_low")
CLOCK = ("clock", "clock_low", "clock_momentum", "clock_momentum_low")


@dataclass(frozen=True, kw_only=True)
class End:
    """End of an earlier result, from which a continuation starts.

    Attributes
    ----------
    state : (1, 4 D) array of float
        Position and momentum of the last sample with the digits below them.
    t : float
        Time of the last sample.
    reference : pair of float
        H0 that errors are relative to; NaN for a result without energies.
    running : (1, 5 D) array of float, or None
        The state of the last force, if the last sample is as the run left it.
    moves : str
        Digest of the moves by which ``running`` may go on.
    """

    state: Floats
    t: float
    reference: tuple[float, float]
    running: Floats | None
    moves: str


def end_digest(variables: Variables, parameters: str) -> str:
    """Return a digest of the last sample of a result, of its ``running``, and of its parameters as text."""
    found = sha256(parameters.encode())
    for name in (*STATE, *CLOCK, "running"):
        if name in variables:
            values = np.asarray(variables[name][1])
            found.update(f" {name} {values.dtype.str} ".encode())
            found.update(values.tobytes() if name == "running" else values[-1:].tobytes())
    return found.hexdigest()


def checked_result(problem: Problem, start: Any) -> xr.Dataset:
    """Return ``start``, if it is a result of the system of ``problem`` that did not diverge.

    Raises
    ------
    SettingError
        Anything else.
    """
    import xarray as xr

    if not (
        isinstance(start, xr.Dataset)
        and all(name in start for name in CONTINUED)
        and start.q.dims == ("sample", "component")
        and start.q.size
    ):
        allowed = "a Dataset that nearharmonic.integrate returned, with all its variables"
        raise bad_setting("start", type(start).__name__, allowed)
    system = problem.system
    if _text(start, "system") != system.name or start.q.shape[1] != system.dimension:
        raise bad_setting("start", f"a result of {start.attrs.get('system')}", f"a result of {system.name}")
    if "formulas" in start.attrs and _text(start, "formulas") != formulas_digest(system):
        what = f"a result of another system of the name {system.name}"
        raise bad_setting("start", what, "one of the same formulas, masses and parameters that are compiled in")
    if str(start.status.values) != "ok":
        what = f"a run that diverged at step {start.diverged_at.values}"
        raise bad_setting("start", what, "a run that did not diverge")
    return start


def parameters_of(start: xr.Dataset) -> Mapping[str, Any]:
    """Return the parameters of a result by name: exact texts, and floats for those that an ensemble has as coordinates.

    Raises
    ------
    SettingError
        The attribute ``parameters`` is no mapping of names to texts.
    """
    text = start.attrs.get("parameters", "{}")
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        allowed = "those of a result, a mapping of names to decimals in JSON"
        raise bad_setting("start.attrs['parameters']", text, allowed)
    names = {str(name).removeprefix("parameter_"): name for name in start.coords if str(name).startswith("parameter_")}
    return {name: start[coordinate].values[()] for name, coordinate in names.items()} | found


def end_of(problem: Problem, start: xr.Dataset) -> End:
    """Return the end of a result that :func:`checked_result` has accepted.

    Raises
    ------
    SettingError
        A variable of another shape, or with a value in its last sample that is not finite.
    """
    d, low = problem.system.dimension, 0 if problem.plain else 1
    state = np.zeros((4, problem.states_dimension))
    for k, (name, clock) in enumerate(zip(STATE, CLOCK, strict=True)):
        if k % 2 and not low:
            continue
        if name in start:
            state[k, :d] = _last(start, name, (d,))
        if clock in start and problem.system.time_dependent:
            state[k, d] = _last(start, clock, ())
    H0, H0_low = (_number(start, name) for name in ("initial_energy", "initial_energy_low"))
    running = None
    if "running" in start and _text(start, "end") == end_digest(_variables(start), start.attrs.get("parameters", "")):
        running = start.running.values[None, :].copy()
    return End(
        state=state.reshape(1, -1), t=float(_last(start, "t", ())), reference=(H0, H0_low), running=running,
        moves=_text(start, "moves"),
    )  # fmt: skip


def _variables(start: xr.Dataset) -> Variables:
    return {str(name): (tuple(map(str, one.dims)), one.values, {}) for name, one in start.variables.items()}


def _text(start: xr.Dataset, name: str) -> str:
    """An attribute, or nothing where it is no text."""
    value = start.attrs.get(name)
    return value if isinstance(value, str) else ""


def _last(start: xr.Dataset, name: str, shape: tuple[int, ...]) -> Floats:
    """The last sample of a variable, of so many finite numbers."""
    one = start[name]
    values = array_of(f"start.{name}", one.values) if one.dims[:1] == ("sample",) else None
    if values is None or values.shape[1:] != shape:
        what = f"{one.dtype} of shape {one.shape} over {' and '.join(map(str, one.dims)) or 'nothing'}"
        raise bad_setting(f"start.{name}", what, f"numbers of shape {(start.sizes['sample'], *shape)} over the samples")
    if not np.isfinite(values[-1]).all():
        raise bad_setting(f"start.{name}[-1]", values[-1].tolist(), "finite numbers, from which a run goes on")
    found: Floats = values[-1].astype(float)
    return found


def _number(start: xr.Dataset, name: str) -> float:
    """A part of H0: a finite number, or NaN where energies were not asked for."""
    values = array_of(f"start.{name}", start[name].values)
    if values is None or values.ndim or np.isinf(values) or (np.isnan(values) and _text(start, "energy") != "none"):
        raise bad_setting(f"start.{name}", start[name].values.tolist(), "a finite number")
    return float(values)
