"""Timed curves as arrays of a cube, and read back; choices of other libraries from them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from math import isfinite, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.numerics.clock import QUARTILES, summary
from nearharmonic.output.dataset import Variables, coordinate, variable
from nearharmonic.recommendation.curve import MEASURES, MODES, Curve, Part, Point
from nearharmonic.recommendation.question import Question
from nearharmonic.recommendation.recommendation import Choice
from nearharmonic.recommendation.step_search import fewest_steps
from nearharmonic.systems import systems

if TYPE_CHECKING:
    import xarray as xr

CUBE = Path("cubes/work_precision.h5")
#: Fields of a point that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Mode that is timed: one trajectory.
TIMED = "trajectory"

_COLUMNS = {
    "tau": ("{t}", "step size; NaN if the method chooses its own"),
    "tau_per_stage": ("{t}", "step size per stage"),
    "tolerance": ("1", "tolerance asked for; NaN if the step size is the setting"),
    "steps": ("1", "steps"),
    "evaluations": ("1", "evaluations of the force; NaN if unknown"),
    "compensated": ("1", "1 if the sums are compensated, 0 if plain; NaN for other libraries"),
    "members": ("1", "trajectories that a call in lanes integrates; NaN if none was timed"),
    "max_energy_error": ("1", "maximum of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "mean_energy_error": ("1", "mean of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "position_error": ("1", "distance from the exact position at the end, over the larger of |q(0)| and |q(t)|"),
}
_MODES = {
    "trajectory": "a whole call for one trajectory, without a look at the energy",
    "lanes": "each trajectory of a whole call for many, in SIMD lanes on one thread, without a look at the energy",
    "energy": "a whole call for one trajectory, the energy measured at every step",
}
_WORDS = {
    "label": "name in legends",
    "kind": "splitting: a method of this package; peer: another library's",
    "status": "ok, or why the curve is empty or ends early",
    "version": "version of the peer's library",
}
_SECONDS = {
    "setup": "a whole call of a prepared problem for one step",
    "sweep": "one call for all step sizes in lanes, energies at every step",
}


def variables(curves: Sequence[Curve], unit: str) -> Variables:
    """Return curves as arrays over (solver, point), padded with NaN; times also over ``quartile``.

    ``unit`` is the unit of time of the system, that of step sizes.
    """
    length = max([len(curve.points) for curve in curves] + [1])
    # Not a dimension "method": xarray's sel() takes that word for itself.
    found = coordinate("solver", [curve.method for curve in curves], "solver")
    for name, text in _WORDS.items():
        found[name] = variable("solver", [getattr(curve, name) for curve in curves], text)
    for name, text in _SECONDS.items():
        found[name] = variable("solver", np.array([getattr(curve, name) for curve in curves], dtype=float), text, "s")
    for name, (units, text) in _COLUMNS.items():
        values = np.full((len(curves), length), nan)
        for row, curve in zip(values, curves, strict=True):
            row[: len(curve.points)] = [getattr(point, name) for point in curve.points]
        found[name] = variable(("solver", "point"), values, text, units.format(t=unit))
    found |= coordinate("quartile", QUARTILES, "minimum and quartiles")
    for mode, text in _MODES.items():
        times = np.full((len(curves), length, len(QUARTILES)), nan)
        repeats = np.zeros((len(curves), length), np.int64)
        for i, curve in enumerate(curves):
            for j, point in enumerate(curve.points):
                times[i, j] = summary(point.times.get(mode, []))
                repeats[i, j] = len(point.times.get(mode, []))
        found[f"time_{mode}"] = variable(("solver", "point", "quartile"), times, f"wall time of {text}", "s")
        found[f"repeats_{mode}"] = variable(("solver", "point"), repeats, f"repeats of {text}")
    return found


def curves_of(group: xr.Dataset, quartile: str = "min") -> list[Curve]:
    """Return the curves that :func:`variables` put into ``group``, with one time of each point.

    ``quartile`` is one of :data:`nearharmonic.numerics.clock.QUARTILES`.
    """
    return [_curve_of(group.isel(solver=i), quartile) for i in range(group.sizes["solver"])]


def _curve_of(rows: xr.Dataset, quartile: str) -> Curve:
    words = {name: str(rows[name].item()) for name in _WORDS}
    seconds = {name: float(rows[name].item()) for name in _SECONDS}
    curve = Curve(method=str(rows["solver"].item()), **words, **seconds)  # type: ignore[arg-type]
    columns = {name: rows[name].values for name in _COLUMNS}
    least = {mode: rows[f"time_{mode}"].sel(quartile=quartile).values for mode in MODES}
    for i in range(rows.sizes["point"]):
        if np.isnan(columns["tau"][i]) and np.isnan(columns["tolerance"][i]):
            continue
        times = {mode: [float(values[i])] for mode, values in least.items() if isfinite(values[i])}
        values_here = {name: float(values[i]) for name, values in columns.items()}
        curve.points.append(Point(times=times, **values_here))  # type: ignore[arg-type]
    return curve


def read_parts(path: str | os.PathLike[str], system: str, quartile: str = "min") -> tuple[list[Part], dict[str, Any]]:
    """Return every interval of a system in a cube, and the cube's attributes.

    Raises
    ------
    ResultFileError
        As :func:`nearharmonic.output.store.read` does.
    """
    from nearharmonic.output import store

    attributes = store.attributes_of(path)
    with store.as_written(path):
        parts: list[Part] = [
            (told["t_end"], tuple(told["measures"]), curves_of(store.read(path, name), quartile))
            for name, told in json.loads(attributes["problems"]).items()
            if told["system"] == system
        ]
    return parts, attributes


def library_choices(asked: Question, results: Path) -> tuple[list[Choice], str]:
    """Return the choices of other libraries from the timings in a folder of results, and their origin as text.

    Raises
    ------
    ResultFileError
        The file of timings cannot be read.
    """
    path, system = results / CUBE, asked.system
    if system.name not in systems or systems[system.name] is not system:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if asked.measure in measures and Fraction(end) == Fraction(asked.t_end):
            choices = [_library_choice(curve, asked) for curve in curves if curve.kind == "peer"]
            return choices, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _library_choice(curve: Curve, asked: Question) -> Choice:
    """Return the fastest setting that meets the bound, if all finer settings meet it too."""
    reason = "" if curve.status == "ok" else curve.status
    choice = Choice(method=curve.method, label=curve.label, kind="peer", status="not run", reason=reason)
    if not curve.points:
        return choice
    errors = {i: float(getattr(point, MEASURES[asked.measure])) for i, point in enumerate(curve.points)}
    times = [min(point.times.get(TIMED, ()), default=nan) for point in curve.points]
    first = fewest_steps(errors, asked.error)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = (
        min(settings, key=times.__getitem__) if settings else min(errors, key=lambda i: (isnan(errors[i]), errors[i]))
    )
    point = curve.points[best]
    return replace(
        choice,
        status="met" if settings else "missed",
        error=errors[best],
        time=times[best] if settings else nan,
        **{name: getattr(point, name) for name in SHARED},
    )
