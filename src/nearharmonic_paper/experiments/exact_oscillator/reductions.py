"""Quantiles of the energy error over the trajectories, energies at which methods cross, and costs on this machine.

The dataset has ``energy_error`` over (tau_per_stage, integrator, energy, trajectory), ``exact_energy_error`` over
(tau_per_stage, charge, exact_integrator, energy, trajectory), and the attribute ``seed``, which chooses the resamples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from itertools import product
from math import sqrt
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from nearharmonic.engine.ensemble import ensemble
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL
from nearharmonic.engine.trajectory import Problem
from nearharmonic.math import exp, log
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor, summary
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import bounds_coordinate, coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper.experiments.exact_oscillator import ExactOscillatorSettings
from nearharmonic_paper.experiments.exact_oscillator.run import starts_on
from nearharmonic_paper.tasks.provenance import measures_time
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

Values = TypeVar("Values", xr.DataArray, xr.Dataset)

QUANTILES = (0.05, 0.5, 0.95)
#: Number of resamples of the trajectories, and coverage of the interval.
RESAMPLES, CONFIDENCE = 200, 0.95
#: Number of resamples that are computed together, to limit the memory.
TOGETHER = 10
TAILS = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)


@reduction("energy_error", over="trajectory")
def energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the trajectories of the energy error with T and V."""
    return _quantiles(runs.energy_error)


@reduction("exact_energy_error", over="trajectory")
def exact_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the trajectories of the energy error with the oscillator solved exactly."""
    return _quantiles(runs.exact_energy_error)


@reduction("energy_error", "exact_energy_error", over="trajectory")
def crossings(runs: xr.Dataset) -> xr.Dataset:
    """Energies up to which the exact oscillator errs less: than each method, and than the best, with intervals."""
    count = runs.sizes["trajectory"]
    draws = np.random.default_rng(runs.attrs["seed"]).integers(0, count, (RESAMPLES, count))
    places = [xr.DataArray(some, dims=("resample", "trajectory")) for some in np.split(draws, RESAMPLES // TOGETHER)]
    parts = [crossings_of_medians(runs.isel(trajectory=some)) for some in places]
    resamples = xr.concat(parts, "resample", coords="minimal", compat="override")
    found = crossings_of_medians(runs)
    bounds = ranked(resamples, "resample", TAILS, "bound").assign_coords(bounds_coordinate())
    for name, what in (
        ("crossing", "an integrator that splits into T and V"),
        ("best_crossing", "the best integrator that splits into T and V, chosen at each energy"),
    ):
        text = f"energy H up to which the exact oscillator has a smaller median error than {what}"
        interval = f"{text}: {CONFIDENCE:.0%} interval by resampling the trajectories"
        found[name] = found[name].assign_attrs(described(f"{text}; 0 if never, inf if always"))
        found[f"{name}_interval"] = bounds[name].assign_attrs(described(interval))
    return found


def crossings_of_medians(runs: xr.Dataset) -> xr.Dataset:
    """Return ``crossing`` (tau_per_stage, charge, exact_integrator, integrator) and ``best_crossing``, by medians."""
    medians = runs[["energy_error", "exact_energy_error"]].median("trajectory", skipna=False)
    split, exact = (xr.apply_ufunc(log, one) for one in medians.data_vars.values())

    def crossed(other: xr.DataArray) -> xr.DataArray:
        found: xr.DataArray = xr.apply_ufunc(
            crossing, exact - other, input_core_dims=[["energy"]], kwargs={"energies": runs.energy.values}
        )
        return found

    return xr.Dataset({"crossing": crossed(split), "best_crossing": crossed(split.min("integrator"))})


def crossing(logarithms: Floats, energies: Floats) -> Floats:
    """Return the energies (...) up to which the error with the exact oscillator is smaller.

    ``logarithms`` (..., E): log of its error over the other method's error, at each of the ascending ``energies``.
    The result is the first energy at which the logarithm exceeds 0, interpolated in the logarithm of the energy; 0 if
    it exceeds 0 at the first energy, infinite if it never does.
    """
    log_energy, worse = log(energies), logarithms > 0
    first = worse.argmax(axis=-1)
    behind = np.maximum(first, 1)
    low, high = (np.take_along_axis(logarithms, (behind - k)[..., None], -1)[..., 0] for k in (1, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.clip(np.where(np.isfinite(high), -low / (high - low), 0.0), 0.0, 1.0)
    found = exp(log_energy[behind - 1] + part * (log_energy[behind] - log_energy[behind - 1]))
    return np.where(worse.any(axis=-1), np.where(first > 0, found, 0.0), np.inf)


def ranked(values: Values, over: str, fractions: Sequence[float], name: str) -> Values:
    """Return the quantiles of ``values`` along ``over`` as a new dimension ``name``, without interpolation.

    Interpolation would fail because errors of diverged trajectories are infinite.
    """
    count = values.sizes[over]
    ranks = xr.DataArray([min(count - 1, int(fraction * count)) for fraction in fractions], dims=name)
    ascending: Values = xr.apply_ufunc(np.sort, values, input_core_dims=[[over]], output_core_dims=[[over]])
    return ascending.isel({over: ranks}).drop_vars(over, errors="ignore")


def _quantiles(errors: xr.DataArray) -> xr.DataArray:
    fractions = coordinate("quantile", list(QUANTILES), "fraction of the trajectories that err less")
    found = ranked(errors, "trajectory", QUANTILES, "quantile").assign_coords(fractions)
    text = f"quantile over the trajectories of the {errors.attrs['long_name']}"
    return found.assign_attrs(described(text))


# --- Table of crossings -----------------------------------------------------------------------------------------------

#: Entry in place of a method name: the best method for T and V at each energy.
BEST = "best of T + V"
CAPTION = (
    "Hénon-Heiles system, equal cost. Energy H and amplitude sqrt(2H) up to which a method that solves the oscillator "
    "exactly has a smaller median energy error than a method that splits H into T and V. The charge is the cost of an "
    f"evaluation with the exact oscillator over one without. {CONFIDENCE:.0%} intervals. 0: nowhere, inf: everywhere."
)


def crossing_table(cube: xr.Dataset) -> Table:
    """Return a row for each step size, charge and pair of methods."""
    header = ["tau_per_stage", "charge", "exact oscillator", "T + V", "energy", "energy_low", "energy_high"]
    header += ["amplitude", "amplitude_low", "amplitude_high"]
    rows: list[list[Any]] = []
    over = ("tau_per_stage", "charge", "exact_integrator")
    for place in product(*(range(cube.sizes[name]) for name in over)):
        one = cube.isel(dict(zip(over, place, strict=True)))
        head = [one[name].item() for name in ("tau_per_stage", "charge", "exact_label")]
        found = [(BEST, one.best_crossing, one.best_crossing_interval)]
        found += zip(one.label.values.tolist(), one.crossing, one.crossing_interval, strict=True)
        for label, energy, bounds in found:
            numbers = [energy.item(), *bounds.values.tolist()]
            rows.append([*head, label, *numbers, *(sqrt(2 * H) for H in numbers)])
    return Table(header=header, rows=rows, caption=CAPTION)


def reduce(split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of quantiles and crossings, and its ``table``, from the path of the file ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    runs = read(run)
    runs.attrs = {"seed": settings.seed}
    cube = reduction.of(runs, over="trajectory")
    return {"cube": cube, "table": crossing_table(cube)}


# --- Cost of the exact oscillator on this machine ---------------------------------------------------------------------

#: Number of members of the timed ensemble.
MEMBERS = 256
#: Integration intervals of one trajectory and of the ensemble in the timing: a millisecond or more.
LONG, SHORT = 20_000, 4_000
PATIENCE = Patience(least=9, most=41, seconds=0.3, longest=3.0)
CAPTION_OF_TIMES = (
    "Hénon-Heiles system: nanoseconds of an evaluation with T + V and with the oscillator solved exactly, compensated "
    "sums, no energies, minimum of interleaved calls. The charge is the ratio of the smallest times of all methods. "
    "Energy H and amplitude sqrt(2H) up to which the exact oscillator has a smaller median error at equal time than "
    "the best method with T + V"
)


@measures_time
def measure_times(cube: str, exact: Sequence[str], settings: ExactOscillatorSettings) -> dict[str, Any]:
    """Return the ``table`` of times and of crossings at equal time; the first step size of the settings is timed.

    ``cube`` is the path of the cube of crossings at given charges.
    """
    found, timed = read(cube), []
    with pinned():
        for name in exact:
            for what, calls, evaluations in _calls(name, settings):
                found_times = [summary(times) for times in interleaved(calls, PATIENCE)]
                timed.append((what, name, [(least / evaluations, middle) for least, _, middle, _ in found_times]))
    # All methods share the two kernels, so that a disturbance of one measurement does not affect all.
    charges = {
        what: min(exact[0] for kind, _, (_, exact) in timed if kind == what)
        / min(split[0] for kind, _, (split, _) in timed if kind == what)
        for what in dict.fromkeys(kind for kind, _, _ in timed)
    }
    rows = [
        [what, name, split[0] * 1e9, rotated[0] * 1e9, rotated[1] / split[1], charges[what], tau, H, sqrt(2 * H)]
        for what, name, (split, rotated) in timed
        for tau in found.tau_per_stage.values.tolist()
        for H in (crossing_at(found, name, tau, charges[what]),)
    ]
    header = ["runs", "integrator", "ns_split", "ns_exact", "ratio_of_medians", "charge", "tau_per_stage"]
    header += ["energy", "amplitude"]
    return {"table": Table(header=header, rows=rows, caption=f"{CAPTION_OF_TIMES}; {processor()}.")}


def crossing_at(cube: xr.Dataset, name: str, tau: float, charge: float) -> float:
    """Return the energy of crossing with the best T + V method at a charge between two charges of the cube.

    It is interpolated in the logarithm if both neighbours have a crossing; otherwise it is the smaller one.
    """
    one = cube.best_crossing.sel(exact_integrator=name, tau_per_stage=tau)
    charges, energies = one.charge.values, one.values
    if charge <= charges[0]:
        return float(energies[0])
    behind = min(int(np.searchsorted(charges, charge)), charges.size - 1)
    low, high = energies[behind - 1], energies[behind]
    if not (0 < high < np.inf and 0 < low < np.inf):
        return float(high)
    return float(np.exp(np.interp(charge, charges[behind - 1 : behind + 1], np.log([low, high]))))


def _calls(name: str, settings: ExactOscillatorSettings) -> Iterator[tuple[str, list[Callable[[], Any]], int]]:
    """Yield a name, the calls with T + V and with the exact oscillator, and their numbers of evaluations."""
    splits = KINETIC_POTENTIAL, EXACT_OSCILLATOR
    problems = [Problem(SYSTEM, name, t_end=LONG, energy="none", split=split) for split in splits]
    tau = float(Fraction(settings.tau_per_stage[0]) * problems[0].tableau.stages)
    evaluations = problems[0].tableau.stages * problems[0].steps_of(tau)
    singles: list[Callable[[], Any]] = [partial(problem, tau) for problem in problems]
    for call in singles:
        call()
    yield "one trajectory", singles, evaluations
    start = starts_on(1 / 80, MEMBERS, 1).reshape(MEMBERS, 4, 2)
    given: dict[str, Any] = {"q0": start[:, 0], "p0": start[:, 2], "t_end": SHORT, "energy": "none"}
    many: list[Callable[[], Any]] = [partial(ensemble, SYSTEM, name, tau, **given, split=split) for split in splits]
    for call in many:
        call()
    yield "ensemble", many, problems[0].tableau.stages * round(SHORT / tau) * MEMBERS
