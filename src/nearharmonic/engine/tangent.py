"""Deviations from orbits: Lyapunov exponents and other indicators of chaos, from the derivative of the discrete map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.description import (
    parameter_variables,
    run_attributes,
    status_variable,
    step_used,
    without_members,
)
from nearharmonic.engine.execution import energy_unit, surface_limit
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_THREADS, checked_count, checked_samples
from nearharmonic.engine.setup import CLOCK, STATE, Setup, asked_steps, check_memory, members_are_given, start_of
from nearharmonic.engine.solution import Solution
from nearharmonic.engine.variation import (
    Deviations,
    check_differentiable,
    initial_deviations,
    running_size,
    schedule_of,
    tangent_system,
)
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers, student_975
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.variation import Deviations, Evolution


# --- Results of deviations as described variables and Datasets.
def deviations_dataset(
    problem: Setup, runs: Deviations, found: Evolution, *, only_end: bool, several: bool, asked_tau: float
) -> xr.Dataset:
    """Return the Dataset of :func:`nearharmonic.tangent`, of ``runs`` of M orbits and what was ``found``.

    ``only_end`` leaves out t = 0, and ``several`` gives a dimension of members.
    """
    begin = runs.begin
    system, kept, steps = problem.system, found.schedule.kept, found.schedule.steps
    unit = system.units["t"]
    times = kept * float(problem.end) / steps + 0.0
    elapsed = abs(times) if runs.earlier is None else abs(times + runs.earlier[0, -3])
    error, H0 = energy_errors(problem, found.states, begin.parameters, begin.reference[0])
    left_at = left_energy_surface(problem, error, kept, found.left_at)
    gone = (left_at[:, None] > 0) & (kept >= left_at[:, None])
    rate = "1" if unit == "1" else f"1/{unit}"
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
        "tau": step_used(problem, steps),
        "steps": ((), steps, described("steps that cover [0, t_end]")),
    }
    variables = variables | parameter_variables(problem, begin.parameters) if several else without_members(variables)
    if "gali" in variables:
        number = "number of the deviations of a volume"
        variables["order"] = ("order",), np.arange(2, lanes + 1), described(number)
    attributes = run_attributes(problem, begin, asked_tau) | {"energy": "samples"}
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


def tangent(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    samples: int = 100,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    deviations: object = 2,
    split: str = KINETIC_POTENTIAL,
    threads: int = 1,
    start: xr.Dataset | Solution | None = None,
) -> xr.Dataset:
    """Follow small deviations from orbits by the exact derivative of the discrete map, for indicators of chaos.

    The derivative of a step is the same step of a separable system of twice as many coordinates, whose formulas are
    derived from those of ``system``. It is symplectic to rounding. The interval [0, t_end] has
    ``steps = max(1, round(|t_end| / tau))`` equal steps. A deviation is integrated in a SIMD lane of its own.
    Deviations are orthonormalised after at most a hundred steps, so that none overflows.

    Parameters
    ----------
    system, integrator : str, or System and Tableau
        Problem and method, or their names. V must be a formula, as it is differentiated twice.
    tau, t_end, precision, summation, first
        As for :func:`nearharmonic.integrate`. In extended precision the orbit has about 32 digits, and deviations are
        rounded to doubles after each part of a run.
    samples : int
        Most samples, first t = 0, as evenly spaced as whole steps allow; 1 keeps the end alone.
    q0, p0 : (d,) or (M, d) array of float, optional
        Initial values; rows are for M members, with a dimension ``member``. Rows of decimal strings are exact.
    parameters : mapping, optional
        Values by name: one for all members, or (M,) arrays of float.
    deviations : int or (k, 2 d) array of float
        Initial deviations from each orbit, d q-parts and then d p-parts a row; or their number k, from 1 to 2 d, for k
        orthonormal ones in fixed directions, the same in each call. An exponent needs one, SALI two, the spectrum 2 d.
    split : {"kinetic_potential"}
        As for :func:`nearharmonic.integrate`; no other split has deviations.
    threads : int
        Threads that share the members; bits do not depend on it.
    start : xarray.Dataset or Solution, optional
        Continue the orbits from the last sample of this result, as for :func:`nearharmonic.integrate`. The deviations
        and indicators of a result of this function go on as in one run, to rounding; those of another begin there.

    Returns
    -------
    xarray.Dataset
        Over sample, and over member if there are several. At t = 0 ratios over the time are NaN. What follows
        divergence is NaN. Lengths are those of (q, p) as numbers in the units of the system:

        - ``q`` and ``p`` over component, and ``energy_error`` in double precision.
        - ``growth`` over deviation: logarithm of the length of a deviation over its initial length.
        - ``lyapunov_exponent``: growth of the first deviation over the time, the largest exponent for long times.
        - ``lyapunov_spectrum`` over deviation: mean growth of the axes of the frame, descending for long times.
        - ``sali``: smaller length of the sum and the difference of the first two deviations of length 1.
        - ``gali`` over order: volume of the parallelepiped of so many deviations of length 1.
        - ``megno``: mean over time of the mean exponential growth of nearby orbits. It tends to 2 for a quasi-periodic
          orbit, to 0 for a harmonic oscillator, and grows like half the exponent times t for a chaotic orbit.

        At the end, over member if there are several:

        - ``lyapunov_low``, ``lyapunov_high``: 95 % interval of Student's t from ten blocks of the time of this call. It
          covers the exponent of the chaotic region of the orbit if a block is longer than the memory of the orbit. It
          does not cover the 0 of a regular orbit, for which growth over time falls like (ln t)/t.
        - ``deviation_q``, ``deviation_p`` over (deviation, component): final deviations, scaled to length 1. Times
          exp(growth) and the initial length, they are the tangent map times the initial deviation.
        - ``max_energy_error`` over the samples, ``initial_energy``, ``status``, ``diverged_at``, ``evaluations`` of the
          gradient by all lanes of the orbit; and for all members ``steps`` and ``tau``.

    Raises
    ------
    NearharmonicError
        An unknown name, a setting outside what is allowed, or a system that cannot be differentiated twice, before any
        work.
    KeyboardInterrupt
        Ctrl-C.

    Notes
    -----
    Spectrum and frames: Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9. SALI: Skokos (2001), J. Phys.
    A 34, 10029. GALI: Skokos, Bountis & Antonopoulos (2007), Physica D 231, 30. MEGNO: Cincotta & Simo (2000), Astron.
    Astrophys. Suppl. 147, 205; Cincotta, Giordano & Simo (2003), Physica D 182, 151. Derivative of a step as a
    step: Skokos & Gerlach (2010), Phys. Rev. E 82, 036704.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> starts = {"q0": [[0, 0.1], [0, -0.15]], "p0": [[0.4, 0.1], [0.49, 0]]}
    >>> orbits = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=2000, **starts)
    >>> (orbits.megno.isel(sample=-1) > 4).values.tolist()
    [False, True]
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy="none",
        split=checked_split(split),
    )  # fmt: skip
    subject = problem.system
    check_differentiable(subject)
    if isinstance(start, Solution):
        start = start.to_dataset()
    begin = start_of(problem, q0, p0, parameters, start, several=True)
    earlier = None if start is None else earlier_indicators(problem, start, deviations)
    rows = initial_deviations(deviations if earlier is None else earlier.sizes["deviation"], subject.dimension)
    kept, (steps, asked_tau) = checked_samples(samples), asked_steps(problem, tau)
    threads = checked_count("threads", threads, MOST_THREADS)
    schedule = schedule_of(steps, max(kept, 2))
    extended = Setup(
        tangent_system(subject), problem.tableau, t_end=problem.t_end, precision=precision, summation=summation,
        energy="none",
    )  # fmt: skip
    going_on = None if earlier is None else np.atleast_2d(earlier["running"].values)
    runs = Deviations(extended, subject.dimension, begin, rows, going_on)
    numbers = begin.members * schedule.kept.size * (4 * problem.states_dimension + 3 * len(rows) + 2)
    check_memory(f"the samples of {begin.members} members", numbers, samples)
    found = runs.follow(schedule, threads)
    several = members_are_given(q0, p0, parameters, start)
    return deviations_dataset(problem, runs, found, only_end=kept == 1, several=several, asked_tau=asked_tau)


def earlier_indicators(problem: Setup, start: xr.Dataset, deviations: object) -> xr.Dataset | None:
    """Return ``start``, a result of this function that goes on; None if it is a result without deviations.

    Other ``deviations``, the other direction of time and damaged numbers raise an error.
    """
    if "deviation" not in start.sizes:
        return None
    k = start.sizes["deviation"]
    if not (isinstance(deviations, int) and deviations in (2, k)):
        raise bad_setting("deviations", deviations, f"those of start= go on, {k} in number")
    start = start.transpose("member", "sample", ..., missing_dims="ignore")
    n, running = 2 * problem.system.dimension, start.get("running", start.q)
    size, values = running_size(k, n), running.values
    if running.dims[-1] != "running_component" or values.shape[-1] != size or not np.isfinite(values).all():
        raise bad_setting("start.running", f"{values.dtype} of shape {values.shape}", f"{size} finite numbers a member")
    if not np.array_equal(start["growth"].isel(sample=-1).values, values[..., k * (n + k) : k * (n + k + 1)]):
        raise bad_setting("start", "a result whose last sample is not that of the run", "one with its last sample")
    if (values[..., -3] * float(problem.end) <= 0).any():
        raise bad_setting("t_end", problem.t_end, "with start=, indicators go on in the direction of their time")
    return start


def checked_split(split: object) -> str:
    """Return ``split``, if a derivative is implemented for it."""
    if split != KINETIC_POTENTIAL:
        raise bad_setting("split", split, f"{KINETIC_POTENTIAL}: derivatives are of kicks and drifts alone")
    return KINETIC_POTENTIAL
