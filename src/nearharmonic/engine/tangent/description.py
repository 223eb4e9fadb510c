"""Results of deviations as described variables and Datasets."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch.results import energy_unit, surface_limit
from nearharmonic.engine.runs.continuation import CLOCK, STATE, Start
from nearharmonic.engine.runs.description import parameter_variables, problem_attributes, status_variable
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.numerics.statistics import student_975
from nearharmonic.numerics.types import Floats, Integers
from nearharmonic.output.dataset import Variables, assembled, described

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.tangent.evolution import Deviations, Evolution


def deviations_dataset(
    problem: Setup, runs: Deviations, found: Evolution, *, only_end: bool, several: bool, begin: Start
) -> xr.Dataset:
    """Return the Dataset of :func:`nearharmonic.engine.tangent.tangent.tangent`.

    Parameters
    ----------
    problem : Setup
        System of d coordinates and method.
    runs, found : Deviations and Evolution
        Deviations from M orbits, and their evolution.
    only_end, several : bool
        True to leave out t = 0; True for a dimension of members.
    begin : Start
        Initial values of the orbits.
    """
    system, kept, steps = problem.system, found.schedule.kept, found.schedule.steps
    unit = system.units["t"]
    times = kept * float(problem.end) / steps + 0.0
    elapsed = abs(times) if runs.earlier is None else abs(times + runs.earlier[0, -3])
    error, H0 = energy_errors(problem, found.states, runs.parameters, begin.reference[0])
    left_at = left_energy_surface(problem, error, kept, found.left_at)
    gone = (left_at[:, None] > 0) & (kept >= left_at[:, None])
    rate = described_rate(unit)
    with np.errstate(all="ignore"):
        exponent, spectrum = found.growth[..., 0] / elapsed, found.stretching / elapsed[:, None]
        own = (found.growth[:, -1, 0] - found.growth[:, 0, 0]) / abs(times[-1])
    d = system.dimension
    q, p = found.states[..., 0, :d], found.states[..., 2, :d]
    timed = ", H = T + V + p_t" if system.time_dependent else ""
    over_sample: dict[str, tuple[tuple[str, ...], Any, dict[str, str]]] = {
        "q": (("component",), q, described("position", system.units["q"])),
        "p": (("component",), p, described("momentum", system.units["p"])),
        "energy_error": ((), error, described(f"(H - H0)/|H0|, or over the system's scale of energies{timed}")),
        "lyapunov_exponent": ((), exponent, described("ln|delta|/t of the first deviation delta up to the time", rate)),
        "lyapunov_spectrum": (("deviation",), spectrum, described("mean logarithmic growth of the axes", rate)),
        "growth": (("deviation",), found.growth, described("ln(|delta|/|delta(0)|)")),
        "megno": ((), found.megno, described("mean over time of the mean exponential growth of nearby orbits")),
    }
    if found.gali.shape[-1]:
        over_sample["sali"] = (), found.sali, described("smaller alignment index of the first two deviations")
        over_sample["gali"] = ("order",), found.gali, described("volume of so many deviations of length 1")
    for k, (name, clock) in enumerate(zip(STATE, CLOCK, strict=True)):
        if k % 2 and problem.numerics.compensated:
            notes = described(f"digits below {name[0]}", system.units[name[0]])
            over_sample[name] = ("component",), found.states[..., k, :d], notes
        if system.time_dependent:
            notes = described(clock.replace("_", " "), unit if k < 2 else system.units["energy"])
            over_sample[clock] = (), found.states[..., k, d], notes
    variables: Variables = {}
    for name, (dimensions, values, notes) in over_sample.items():
        kept_values = np.where(gone.reshape(*gone.shape, *(1,) * len(dimensions)), np.nan, values)[:, int(only_end) :]
        variables[name] = ("member", "sample", *dimensions), kept_values, notes
    over_member = end_variables(found, own, left_at, float(problem.end), rate)
    worst = np.where(left_at > 0, inf, np.fmax.reduce(np.abs(error), axis=1))
    over_member |= {
        "max_energy_error": (("member",), worst, described("maximum of |energy_error| over the samples, inf if lost")),
        "initial_energy": (("member",), H0, described("energy H0 at the start", system.units["energy"])),
        "initial_energy_low": (("member",), 0 * H0, described("digits below initial_energy", system.units["energy"])),
        "running": (("member", "running_component"), found.running, described("frame, time and means", "unknown")),
        "status": status_variable("member", problem, left_at, found.unsolved),
        "evaluations": (("member",), found.evaluations, described("evaluations of the gradient by all lanes")),
        "diverged_at": (("member",), left_at, described("step at which divergence was seen, 0 if none was")),
    }
    variables |= over_member
    lanes = len(runs.initial)
    variables |= {
        "t": (("sample",), times[int(only_end) :] + begin.t, described("time", unit)),
        "tau": ((), problem.taus(np.array([steps]))[0], described("step size as used, t_end / steps", unit)),
        "steps": ((), steps, described("steps that cover [0, t_end]")),
    }
    if several:
        variables |= parameter_variables(problem, runs.parameters)
    else:
        variables = {
            name: (dimensions[1:], values[0], notes) if dimensions[:1] == ("member",) else (dimensions, values, notes)
            for name, (dimensions, values, notes) in variables.items()
        }
    if "gali" in variables:
        number = "number of the deviations of a volume"
        variables["order"] = ("order",), np.arange(2, lanes + 1), described(number)
    attributes = problem_attributes(problem) | begin.attributes() | {"energy": "samples"}
    coordinates = ["t", "order", *(name for name in variables if name.startswith("parameter_"))]
    return assembled(variables, coordinates, attributes)


def end_variables(found: Evolution, exponent: Floats, left_at: Integers, t_end: float, rate: str) -> Variables:
    """Return the interval of the exponents (M,) and the final deviations."""
    bounds = np.diff(found.schedule.bounds) / found.schedule.steps * abs(t_end)
    rates, count = found.blocks / bounds, len(bounds)
    half = np.full(len(exponent), np.nan)
    if count > 1:
        spread = rates - rates.mean(axis=1, keepdims=True)
        half = student_975(count - 1) * np.sqrt((spread * spread).sum(axis=1)) / sqrt((count - 1) * count)
    deviations = np.where(left_at[:, None, None] > 0, np.nan, found.deviations)
    half[left_at > 0] = np.nan
    d, over = deviations.shape[-1] // 2, ("member", "deviation", "component")
    what = "end of the 95 % interval of the exponent, from blocks of time"
    return {
        "lyapunov_low": (("member",), exponent - half, described(f"lower {what}", rate)),
        "lyapunov_high": (("member",), exponent + half, described(f"upper {what}", rate)),
        "deviation_q": (over, deviations[..., :d], described("q-part of the final deviation of length 1")),
        "deviation_p": (over, deviations[..., d:], described("p-part of the final deviation of length 1")),
    }


def described_rate(unit: str) -> str:
    """Return the unit of an exponent for this unit of time."""
    return "1" if unit == "1" else f"1/{unit}"


def energy_errors(problem: Setup, states: Floats, parameters: Floats, reference: Any) -> tuple[Floats, Floats]:
    """Return relative energy errors (M, S) of states (M, S, 4, D) in double precision, and H0 (M,).

    H0 is ``reference``, or where this is NaN the energy of the first state.
    """
    system = problem.system
    d = system.dimension
    q, p = (tuple(np.moveaxis(states[..., part, :], -1, 0)) for part in (0, 2))
    constants: Sequence[Any] = [column[:, None] if len(column) > 1 else column[0] for column in parameters.T[::2]]
    with np.errstate(all="ignore"):
        t = q[d] if system.time_dependent else None
        H = np.broadcast_to(system.energy(q[:d], p[:d], constants, t), q[0].shape)
        H = H + p[d] if system.time_dependent else H
        H0 = np.where(np.isnan(reference), H[:, 0], reference)
        return (H - H0[:, None]) / energy_unit(H0, problem.scale)[:, None], H0


def left_energy_surface(problem: Setup, error: Floats, kept: Integers, left_at: Integers) -> Integers:
    """Return the step (M,) at which each orbit has diverged, 0 if it has not: by a sample's error, or not finite."""
    beyond = ~(np.abs(error) <= surface_limit(problem.system, problem.scale))
    seen = np.where(beyond.any(axis=1), kept[beyond.argmax(axis=1)], 0)
    return np.where((left_at > 0) & ((seen == 0) | (left_at < seen)), left_at, seen)
