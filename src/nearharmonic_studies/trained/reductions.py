"""Reductions of the comparison, of the ideas and of the long runs, over the problems of each ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import frexp, ldexp, sqrt
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats, student_975
from nearharmonic.output.store import bounds_coordinate, coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic.training.family import TRAINED
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.trained.run import CHARGE_OF_ROTATIONS as CHARGE
from nearharmonic_studies.trained.settings import EXACT_IDEAS, IDEAS, ProofSettings

# --- Statistics over problems: quantiles, means over resamples, and the intervals that hold most of these.

#: Number of resamples of the problems, and coverage of an interval.
RESAMPLES, CONFIDENCE = 1000, 0.95
#: Of the anharmonicities of the problems.
QUANTILES = (0.05, 0.5, 0.95)

proof_reduction, ideas_reduction, long_reduction = Reductions(), Reductions(), Reductions()


@proof_reduction("anharmonicity", over="problem")
@ideas_reduction("anharmonicity", over="problem")
def anharmonicity(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the problems of their anharmonicity."""
    problems = "problems" if "ensemble" in runs.dims else "potentials"
    fractions = coordinate("quantile", list(QUANTILES), f"fraction of the {problems} that are less anharmonic")
    found: xr.DataArray = runs.anharmonicity.quantile(QUANTILES, "problem", skipna=False).transpose(..., "quantile")
    return found.assign_coords(fractions).assign_attrs(runs.anharmonicity.attrs)


def resampled_means(values: xr.DataArray, seed: int, resamples: int = RESAMPLES) -> xr.DataArray:
    """Return the means of ``values`` over ``problem`` in each resample of the problems, along ``resample``.

    All methods, step sizes and strengths share the problems of a resample.
    """
    count = values.sizes["problem"]
    counts = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), resamples)
    means: xr.DataArray = xr.apply_ufunc(
        _means, values, kwargs={"counts": counts}, input_core_dims=[["problem"]], output_core_dims=[["resample"]]
    )
    return means


def _means(values: Floats, counts: Floats) -> Floats:
    """Return means (..., R) over the last axis of M problems, weighted by ``counts`` (R, M).

    The order of additions in a matrix product depends on the processor. The values are therefore rounded to multiples
    of a power of two for which all sums are exact in any order: by at most 10^-12 for logarithms of 192 problems. NaN
    stays NaN.
    """
    sizes = counts.sum(axis=1)
    _, exponent = frexp(float(np.nanmax(np.abs(values))) * int(sizes.max()))
    unit = ldexp(1.0, exponent - 52)
    found: Floats = np.rint(values / unit) @ counts.T.astype(float) * unit / sizes
    return found


def interval(values: xr.DataArray) -> xr.DataArray:
    """Return the ends, along ``bound``, of the interval with :data:`CONFIDENCE` of the resamples."""
    tails = [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]
    ends = values.quantile(tails, "resample", skipna=False).rename(quantile="bound")
    return ends.transpose(..., "bound").assign_coords(bounds_coordinate())


def _with_interval(name: str, values: xr.DataArray, resampled: xr.DataArray, text: str, ends: str = "") -> xr.Dataset:
    """Return values in decades and the interval of the same values on resamples."""
    of_ends = described(ends or f"its {CONFIDENCE:.0%} interval", "decades")
    return xr.Dataset({
        name: values.assign_attrs(described(text, "decades")),
        f"{name}_interval": interval(resampled).assign_attrs(of_ends),
    })  # fmt: skip


# --- Mean errors on each ensemble, and the gains of trained methods over published ones.
#
# The dataset has ``log_error`` over (ensemble, integrator, point, problem), ``anharmonicity`` over (ensemble, problem),
# the coordinate ``kind`` of each integrator, and the attribute ``seed``, which chooses the resamples.


@proof_reduction("log_error", over="problem")
def mean_log_error(runs: xr.Dataset) -> xr.DataArray:
    """Mean over the problems of the logarithm of the energy error."""
    text = "mean over the problems of log10 of the largest |H - H0|/|H0| over every step"
    mean: xr.DataArray = runs.log_error.mean("problem", skipna=False)
    return mean.assign_attrs(described(text))


@proof_reduction("log_error", "kind", over="problem")
def gains(runs: xr.Dataset, resamples: int = RESAMPLES) -> xr.Dataset:
    """Best method of each kind, and the gain of the trained one with its interval, at each step size.

    A gain is the mean of log10 (error of the best published method / error of the best trained method). Each
    resample has its own best methods. Without a method of a kind its best is "" and the gain is NaN.
    """
    errors, seed = runs.log_error.reset_coords(drop=True).assign_coords(kind=runs.kind), runs.attrs["seed"]
    chosen = f"its {CONFIDENCE:.0%} interval by resampling the problems, the best of each chosen anew"
    parts = []
    for name in runs.ensemble.values:
        means = errors.sel(ensemble=name).mean("problem", skipna=False)
        resampled = resampled_means(errors.sel(ensemble=name), seed, resamples)
        best = {
            f"best_{kind}": _of(means, kind)
            .idxmin("integrator", fill_value="")
            .assign_attrs(described(f"{kind} method with the least mean error"))
            for kind in ("published", "trained")
        }
        gain = _with_interval("gain", _gain(means), _gain(resampled), "gain of best_trained", chosen)
        parts.append(xr.Dataset(best).assign(gain))
    return xr.concat(parts, "ensemble", coords="minimal", compat="override").assign_coords(ensemble=runs.ensemble)


def _of(means: xr.DataArray, kind: str) -> xr.DataArray:
    return means.where(means.kind == kind)


def _gain(means: xr.DataArray) -> xr.DataArray:
    return _of(means, "published").min("integrator") - _of(means, "trained").min("integrator")


GAINS = (
    "Best published and best trained method on each ensemble at each cost of a step, by the mean of log10 max "
    "|dH/H0|; the gain in decades with its 95 % interval over the problems. Ahead and behind: the interval is above or "
    "below 0. Nothing was trained on these problems."
)
METHODS = (
    "Each trained method on each ensemble: the widest range of neighbouring step sizes at which its error is smaller "
    "than with every published method, its largest gain and loss in decades, and where they are."
)


def gain_table(cube: xr.Dataset) -> Table:
    """Return a row for each ensemble and step size."""
    rows: list[dict[str, Any]] = []
    for e, t in np.argwhere(np.isfinite(cube.tau_per_stage.values)):
        one = cube.isel(ensemble=e, point=t)
        published, trained = (str(one[f"best_{kind}"].item()) for kind in ("published", "trained"))
        low, high = one.gain_interval.values.tolist()
        rows.append({
            "ensemble": one.ensemble.item(), "tau_per_stage": one.tau_per_stage.item(),
            "best published": published or "none", "log10_error": _error(one, published),
            "best trained": trained or "none", "log10_error_trained": _error(one, trained),
            "gain": one.gain.item(), "gain_low": low, "gain_high": high, "verdict": verdict(low, high),
        })  # fmt: skip
    return Table(header=[*rows[0]], rows=[[*row.values()] for row in rows], caption=GAINS)


def verdict(low: float, high: float) -> str:
    """Return what an interval of a gain says."""
    if np.isnan(low):
        return "none trained"
    return "ahead" if low > 0 else "behind" if high < 0 else "even"


def method_table(cube: xr.Dataset) -> Table:
    """Return a row for each trained method and ensemble."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["method", "ensemble", "ahead_from", "ahead_to", "ratio"]
    header += ["largest_gain", "gain_at", "largest_loss", "loss_at"]
    rows = []
    for m in np.flatnonzero(values["kind"] == "trained").tolist():
        for e, ensemble in enumerate(values["ensemble"].tolist()):
            taus = values["tau_per_stage"][e]
            there = np.flatnonzero(np.isfinite(taus))
            gain = gains_of(values, e, m)[there]
            low, high = stretch(taus[there], gain)
            most, least = there[gain.argmax()], there[gain.argmin()]
            ends = [float(gain.max()), float(taus[most]), float(-gain.min()), float(taus[least])]
            rows.append([str(values["integrator"][m]), ensemble, low, high, high / low, *ends])
    return Table(header=header, rows=rows or [["none", *[""] * (len(header) - 1)]], caption=METHODS)


def gains_of(values: Any, ensemble: int, method: int) -> Floats:
    """Return the gains (T,) of one method over the best published one at each step size, from arrays of the cube."""
    errors = values["mean_log_error"][ensemble]
    best = errors[values["kind"] == "published"].min(axis=0)
    found: Floats = best - errors[method]
    return found


def stretch(taus: Floats, gain: Floats) -> tuple[float, float]:
    """Return the ends of the widest range of neighbouring step sizes with a gain above 0; NaN without a gain.

    ``taus``, ``gain`` (T,): step sizes in monotonic order, and gains.
    """
    best, start = (np.nan, np.nan), None
    for i, ahead in enumerate([*(gain > 0), False]):
        if ahead and start is None:
            start = i
        if not ahead and start is not None:
            low, high = sorted((float(taus[start]), float(taus[i - 1])))
            if not high / low <= best[1] / best[0]:
                best = low, high
            start = None
    return best


def _error(one: xr.Dataset, name: str) -> float:
    """Return the mean logarithm of the error of a method; NaN without a method."""
    return float(one.mean_log_error.sel(integrator=name)) if name else float("nan")


def reduce_proof(methods: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of mean errors and gains, the tables of ``gains`` and of trained ``methods``, from ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    runs = read(run).assign_attrs(seed=settings.seed)
    cube = runs.drop_dims("problem").assign(proof_reduction.of(runs, over="problem"))
    cube.attrs = {}
    return {"cube": cube, "gains": gain_table(cube), "methods": method_table(cube)}


# --- The best method of each idea, its gain, and the best idea.
#
# The dataset has ``log_error`` over (integrator, tau_per_stage, strength, problem) with the coordinate ``idea`` of each
# integrator, ``exact_log_error`` over (exact_integrator, ...), ``anharmonicity`` over (strength, problem), and the
# attribute ``seed``. With ``over="resample"`` a reduction takes the errors of the best methods, not of all.


#: Reference idea.
REFERENCE = "general"


@ideas_reduction("log_error", "exact_log_error", "idea", over="problem")
def best_of_ideas(runs: xr.Dataset, resamples: int = RESAMPLES) -> xr.Dataset:
    """Best method of each idea and its mean error, and the errors of the best, chosen anew, in each resample."""
    exact = runs.exact_log_error.rename(exact_integrator="integrator")
    trained = exact.integrator.str.startswith(TRAINED).values
    ideas = {idea: exact.isel(integrator=one) for idea, one in zip(EXACT_IDEAS, (~trained, trained), strict=True)}
    split = [idea for idea in IDEAS if idea not in EXACT_IDEAS]
    ideas |= {idea: runs.log_error.isel(integrator=np.flatnonzero(runs.idea == idea)) for idea in split}
    parts = []
    for idea, errors in ideas.items():
        if errors.sizes["integrator"]:
            means = errors.mean("problem", skipna=False)
            again = resampled_means(errors, runs.attrs["seed"], resamples)
            best = {"mean_log_error": means.min("integrator"), "best_method": means.idxmin("integrator")}
            parts.append(xr.Dataset(best | {"resampled": again.min("integrator")}).expand_dims(idea=[idea]))
    found = xr.concat(parts, "idea", coords="minimal", compat="override").reindex(
        idea=list(IDEAS), fill_value={"best_method": ""}
    )
    for name, text in (
        ("mean_log_error", "mean over the potentials of log10 max |dH/H0|, best method of an idea"),
        ("best_method", "best method of an idea; empty if it has none"),
    ):
        found[name].attrs = described(text)
    meaning = f"what methods are built on; {' and '.join(EXACT_IDEAS)} cost {CHARGE} an evaluation"
    return found.assign_coords(coordinate("idea", list(IDEAS), meaning))


@ideas_reduction("mean_log_error", "resampled", over="resample")
def idea_gains(best: xr.Dataset) -> xr.Dataset:
    """Gain of each idea over the reference, with its interval."""
    gain, resampled = (
        (one.sel(idea=REFERENCE, drop=True) - one).transpose("idea", "tau_per_stage", "strength", ...)
        for one in (best.mean_log_error, best.resampled)
    )
    return _with_interval("gain", gain, resampled, f"gain over the best method of {REFERENCE}")


@ideas_reduction("mean_log_error", "resampled", over="resample")
def exact_gains(best: xr.Dataset) -> xr.Dataset:
    """Gain of trained methods over all others with the oscillator solved exactly, with its interval."""
    gain, resampled = (
        one.sel(idea=EXACT_IDEAS[0], drop=True) - one.sel(idea=EXACT_IDEAS[1], drop=True)
        for one in (best.mean_log_error, best.resampled)
    )
    text = f"gain of the best method of {EXACT_IDEAS[1]} over the best of {EXACT_IDEAS[0]}"
    return _with_interval("exact_gain", gain, resampled, text)


@ideas_reduction("mean_log_error", "resampled", over="resample")
def leaders(best: xr.Dataset) -> xr.Dataset:
    """Idea that is ahead, and its lead over the second with its interval: among all ideas, and for T and V."""
    split = _leaders(best.drop_sel(idea=list(EXACT_IDEAS)), "_split", f"the same without {' and '.join(EXACT_IDEAS)}")
    return _leaders(best, "", "idea with the least mean error").assign(split)


def _leaders(best: xr.Dataset, suffix: str, text: str) -> xr.Dataset:
    errors = best.mean_log_error.fillna(np.inf)
    leader = errors.idxmin("idea")
    second = errors.where(errors.idea != leader).idxmin("idea")
    lead, resampled = (
        one.sel(idea=second).drop_vars("idea") - one.sel(idea=leader).drop_vars("idea")
        for one in (best.mean_log_error, best.resampled)
    )
    says = "lead of the best idea over the second"
    found = _with_interval(f"lead{suffix}", lead, resampled, says, "its 95 % interval")
    return found.assign({f"leader{suffix}": leader.assign_attrs(described(text))})


IDEAS_CAPTION = (
    "Random potentials of two coordinates. The leading idea: its best method has the smallest mean of log10 "
    "max |dH/H0| at equal cost; its lead over the second in decades, with a 95 % interval over the potentials. The "
    "leading idea among those with T + V. The gain of trained methods over all others that solve oscillators exactly. "
    "The gains of all ideas over the best general method. "
    "Anharmonicity is the median variation of the Hessian."
)


def ideas_table(cube: xr.Dataset) -> Table:
    """Return a row for each step size and strength."""
    rows: list[dict[str, Any]] = []
    for t, j in product(range(cube.sizes["tau_per_stage"]), range(cube.sizes["strength"])):
        one = cube.isel(tau_per_stage=t, strength=j)
        best = one.sel(idea=one.leader)
        lead, exact = one.lead_interval.values.tolist(), one.exact_gain_interval.values.tolist()
        rows.append({
            "tau_per_stage": one.tau_per_stage.item(), "anharmonicity": one.anharmonicity[1].item(),
            "ahead": one.leader.item(), "method": best.best_method.item(), "log10_error": best.mean_log_error.item(),
            "lead": one.lead.item(), "lead_low": lead[0], "lead_high": lead[1],
            "ahead with T + V": one.leader_split.item(), "lead with T + V": one.lead_split.item(),
            "exact_gain": one.exact_gain.item(), "exact_gain_low": exact[0], "exact_gain_high": exact[1],
            **dict(zip(IDEAS, one.gain.values.tolist(), strict=True)),
        })  # fmt: skip
    return Table(header=[*rows[0]], rows=[[*row.values()] for row in rows], caption=IDEAS_CAPTION)


def reduce_ideas(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of ideas over step size and strength, and the ``table`` of which is ahead, from ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    best = ideas_reduction.of(read(run).assign_attrs(seed=settings.seed), over="problem")
    cube = best.drop_dims("resample").assign(ideas_reduction.of(best, over="resample"))
    return {"cube": cube, "table": ideas_table(cube)}


# --- The long runs of each system; the dataset has what ``run`` computes, over (system, integrator).


@long_reduction("max_energy_error", over="problem")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Largest error over every step of all problems."""
    largest: xr.DataArray = runs.max_energy_error.max("problem", skipna=False)
    return largest.assign_attrs(runs.max_energy_error.attrs)


@long_reduction("energy_error", "step", over="problem")
def trends(runs: xr.Dataset) -> xr.Dataset:
    """Trend of (H - H0)/|H0| over the whole run with the half width of its 95 % interval.

    The trend is the mean over the problems of the slopes of least-squares lines; the interval assumes independent
    problems. NaN if a run diverged.
    """
    time, count = runs.step / runs.step[-1] - 0.5, runs.problem.size
    slopes = (runs.energy_error * time).sum("sample", skipna=False) / (time * time).sum("sample")
    width = student_975(count - 1) * slopes.std("problem", ddof=1, skipna=False) / sqrt(count)
    trend = slopes.mean("problem", skipna=False)
    return xr.Dataset({
        "trend": trend.assign_attrs(described("trend of (H - H0)/|H0| over the whole run")),
        "trend_half_width": width.assign_attrs(described("half width of the 95 % interval of the trend")),
    })  # fmt: skip


@long_reduction("q", "q_low", "p", "p_low", over="problem")
def way_back(runs: xr.Dataset) -> xr.DataArray:
    """Median distance from the start after the run and the run back with all its digits."""
    errors = []
    for name in "qp":
        start, back = (runs[name].sel(end=end, drop=True) for end in ("start", "back"))
        scale = abs(runs[name].sel(end=["start", "there"])).max(["problem", "end", "component"])
        errors.append(abs(back - start + runs[f"{name}_low"].sel(end="back", drop=True)).max("component") / scale)
    distance = xr.concat(errors, "kind").max("kind", skipna=False).median("problem", skipna=False)
    return distance.assign_attrs(described("median distance from the start, relative to the largest coordinate"))


@long_reduction("fine_energy_error", over="problem")
def rounding(runs: xr.Dataset) -> xr.DataArray:
    """Median over the problems and the second half of the samples of the energy error by rounding."""
    exact = runs.fine_energy_error.sel(arithmetic="extended", drop=True)
    rounded = runs.fine_energy_error.sel(arithmetic=runs.summation.values).rename(arithmetic="summation")
    median: xr.DataArray = xr.apply_ufunc(
        _late_median, abs(rounded - exact), input_core_dims=[["problem", "fine_sample"]], vectorize=True
    )
    return median.assign_attrs(described("median energy error by rounding alone"))


def _late_median(errors: Any) -> float:
    known = errors[:, ~np.isnan(errors).all(axis=0)]
    return float(np.median(known[:, known.shape[1] // 2 :]))


LONG_CAPTION = (
    "Runs from starts on the energy surfaces of the proof. Largest error at any step. Trend of (H - H0)/|H0| over the "
    "whole run, with the half width of its 95 % interval over the starts. Distance from the start after a hundredth of "
    "the steps and as many back, median over the starts, relative to the largest coordinate and momentum. Energy error "
    "by rounding alone, against double-double with the same coefficients, after equally many evaluations with a fifth "
    "of the step, median over the starts and the second half of the run. Its ratio to the first method, with plain "
    "sums."
)


def reduce_long_runs(methods: Sequence[str], beside: str, settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``table`` of long runs; the names and ``settings`` are stored in the files."""
    return {"table": long_table(read(run))}


def long_table(runs: xr.Dataset) -> Table:
    """Return a row for each system and method of ``runs``, with their reductions."""
    reduced, steps, tau = long_reduction.of(runs, over="problem"), int(runs.step[-1]), float(runs.tau_per_stage)
    sums, rows = runs.summation.values.tolist(), []
    for system in map(str, runs.system.values):
        known = float(reduced.rounding.sel(system=system, summation="plain")[0])
        for name in map(str, runs.integrator.values):
            one, method = reduced.sel(system=system, integrator=name), integrators[name]
            total = sum(abs(float(c)) for row in (method.kick, method.drift) for c in row)
            largest, slope, width = (float(one[key]) for key in ("max_energy_error", "trend", "trend_half_width"))
            drift = "no" if abs(slope) <= width else "yes" if abs(slope) > width else "lost"
            numbers = [float(values.sel(summation=each)) for values in (one.way_back, one.rounding) for each in sums]
            rows.append([system, name, steps, tau, total, largest, slope, width, drift, *numbers, numbers[-1] / known])
    header = ["system", "method", "steps", "tau_per_stage", "sum of coefficients", "max_energy_error", "trend"]
    header += ["trend_half_width", "drift", *(f"{what}_{each}" for what in ("return", "rounding") for each in sums)]
    return Table(header=[*header, "rounding_ratio"], rows=rows, caption=LONG_CAPTION)
