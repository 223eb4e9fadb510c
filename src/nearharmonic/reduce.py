"""From run files to cubes, in xarray: one named function for each number, and the functions that line them up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.systems import systems
from nearharmonic.systems.system import System

#: Variables of a run file that the reductions read; trajectories stay on disk.
NEEDED = (
    "tau", "steps", "evaluations", "status", "diverged_at", "t",
    "block_steps", "block_max_energy_error", "block_mean_energy_error", "perihelion_angle",
)  # fmt: skip

#: A curve below this many times its lowest point may be round-off rather than truncation.
PLATEAU = 100.0
#: Above this relative error the leading term no longer decides the slope.
ASYMPTOTIC = 1e-4
#: Largest number of points, taken from the smallest errors above the plateau, that a slope is fitted to: half a decade.
SLOPE_POINTS = 20

ARCSECONDS_PER_RADIAN = 648000 / np.pi
HOURS_PER_CENTURY = 876_600.0


def max_energy_error(run: xr.Dataset) -> xr.DataArray:
    """Maximum over every step of |H - H0|/|H0|, per step size; infinite where the run left its energy surface."""
    largest: xr.DataArray = run.block_max_energy_error.max("sample")
    return largest.where(run.status != "diverged", np.inf)


def mean_energy_error(run: xr.Dataset) -> xr.DataArray:
    """Mean over every step of |H - H0|/|H0|, per step size; infinite where the run left its energy surface."""
    mean: xr.DataArray = (run.block_mean_energy_error * run.block_steps).sum("sample") / run.steps
    return mean.where(run.status != "diverged", np.inf)


def observed_order(tau: xr.DataArray, error: xr.DataArray, dimension: str = "tau_per_stage") -> xr.DataArray:
    """Slope of log(error) against log(tau) over the smallest errors that are truncation, not round-off.

    The plateau is left out: all points up to the largest step size whose error is within a factor of 100 of the
    curve's lowest. So are errors above 1e-4. NaN with fewer than three points left.
    """

    def slope(x: Any, y: Any) -> float:
        finite = np.isfinite(y) & (y > 0) & np.isfinite(x)
        if not finite.any():
            return float("nan")
        near_floor = finite & (y < PLATEAU * max(y[finite].min(), np.finfo(float).eps / 2))
        from_tau = x[near_floor].max(initial=0.0)
        usable = np.flatnonzero(finite & (x > from_tau) & (y < ASYMPTOTIC))
        usable = usable[np.argsort(x[usable])][:SLOPE_POINTS]
        if usable.size < 3:
            return float("nan")
        return float(np.polyfit(np.log(x[usable]), np.log(y[usable]), 1)[0])

    fitted: xr.DataArray = xr.apply_ufunc(slope, tau, error, input_core_dims=[[dimension], [dimension]], vectorize=True)
    return fitted.assign_attrs(units="1", long_name="observed order: slope of the maximum energy error above round-off")


def linear_trend(t: Any, angle: Any) -> tuple[float, float]:
    """Slope of the unwrapped ``angle`` (rad) against ``t``, and the half width of its 95 % interval; NaN if undefined.

    Ordinary least squares; the residuals are periodic rather than independent, so over whole orbits the interval is
    cautious.
    """
    finite = np.isfinite(angle) & np.isfinite(t)
    if finite.sum() < 3:
        return float("nan"), float("nan")
    x, y = t[finite], np.unwrap(angle[finite])
    x = x - x.mean()
    spread = float(x @ x)
    slope = float(x @ y) / spread
    residual = y - y.mean() - slope * x
    deviation = np.sqrt(float(residual @ residual) / (x.size - 2) / spread)
    return slope, student_975(x.size - 2) * float(deviation)


def student_975(freedom: int) -> float:
    """97.5 % point of Student's t, by the Cornish-Fisher series (Abramowitz & Stegun 26.7.5), exact for 1 and 2.

    The relative error is below 2e-3 from 3 degrees of freedom on.
    """
    if freedom == 1:
        return float(np.tan(0.475 * np.pi))
    if freedom == 2:
        return 0.95 * float(np.sqrt(2 / (1 - 0.95**2)))
    z, n = 1.959963984540054, float(freedom)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return z + sum(term / n ** (k + 1) for k, term in enumerate(terms))


def orbital_period(system: System) -> float:
    """Period of the exact orbit from the system's initial values, in its unit of time."""
    if system.period is None:
        return float("nan")
    q, p = (tuple(float(x) for x in row) for row in (system.q0, system.p0))
    return system.period(q, p, *(float(Fraction(parameter.value)) for parameter in system.parameters.values()))


def perihelion_advance(run: xr.Dataset, period: float) -> tuple[xr.DataArray, xr.DataArray]:
    """Advance of the perihelion (rad per orbit, signed) and its 95 % half width, by regression over all orbits."""
    slope, width = xr.apply_ufunc(
        linear_trend,
        run.t,
        run.perihelion_angle,
        input_core_dims=[["sample"], ["sample"]],
        output_core_dims=[[], []],
        vectorize=True,
    )
    kept = run.status != "diverged"
    return (slope * period).where(kept), (width * period).where(kept)


def reduced(run: xr.Dataset, system: System, stages: int) -> xr.Dataset:
    """All that a cube holds of the runs of one integrator, over tau_per_stage."""
    cube = run[["tau", "steps", "evaluations", "status", "diverged_at"]]
    largest, mean = max_energy_error(run), mean_energy_error(run)
    texts = ("maximum of |H - H0|/|H0| over every step", "mean of |H - H0|/|H0| over every step")
    for name, value, text in zip(("max_energy_error", "mean_energy_error"), (largest, mean), texts, strict=True):
        cube[name] = value.assign_attrs(units="1", long_name=f"{text}, inf if diverged")
    if "perihelion_angle" in run:
        period = orbital_period(system)
        advance, width = perihelion_advance(run, period)
        cube["perihelion_advance"] = advance.assign_attrs(units="rad", long_name="perihelion advance per orbit")
        cube["perihelion_advance_interval"] = width.assign_attrs(
            units="rad", long_name="half width of the 95 % interval of the perihelion advance per orbit"
        )
        cube["evaluations_per_orbit"] = (period / cube.tau * stages).assign_attrs(
            units="1", long_name="force evaluations per orbit"
        )
    return cube


def cube(system: str, runs: Mapping[str, Mapping[str, Sequence[xr.Dataset]]]) -> xr.Dataset:
    """The cube of a system from ``runs[integrator][precision]``, the datasets of its shards.

    Dimensions (integrator, tau_per_stage), and precision in front where a system has more than one. Runs that the plan
    left out have status "skipped" and NaN errors.
    """
    problem = systems[system]
    layers: dict[str, list[xr.Dataset]] = {}
    for name, by_precision in runs.items():
        tableau = integrators[name]
        for precision, shards in by_precision.items():
            whole = xr.concat(list(shards), "tau_per_stage", data_vars="all", join="outer").sortby("tau_per_stage")
            one = reduced(whole, problem, tableau.stages)
            layers.setdefault(precision, []).append(one.assign_coords(integrator=name, label=tableau.label))
    stacked = {precision: _stack(members, "integrator") for precision, members in layers.items()}
    if len(stacked) == 1:
        (dataset,) = stacked.values()
    else:
        dataset = _stack([d.assign_coords(precision=precision) for precision, d in stacked.items()], "precision")
    dataset = dataset.sel(integrator=list(runs))  # an outer join of precisions sorts by name
    best = dataset.isel(precision=0, drop=True) if "precision" in dataset.dims else dataset
    dataset["observed_order"] = observed_order(best.tau, best.max_energy_error)
    if "precision" in dataset.dims:
        text = "; or skipped: the plan left the run out (tables/skipped.csv)"
        dataset.status.attrs["long_name"] = f"{dataset.status.attrs['long_name']}{text}"
    dataset.tau_per_stage.attrs |= {"units": problem.units["t"], "long_name": "step size per stage"}
    for coordinate, text in (("integrator", "integrator"), ("label", "name in the paper"), ("precision", "precision")):
        if coordinate in dataset.coords:
            dataset[coordinate].attrs |= {"units": "1", "long_name": text}
    attributes: dict[str, Any] = {"system": system, "system_label": problem.label}
    if problem.period is not None:
        attributes["orbital_period"] = orbital_period(problem)
    return dataset.assign_attrs(attributes)


def _stack(members: Iterable[xr.Dataset], dimension: str) -> xr.Dataset:
    """Concatenate on a new ``dimension``, filling what a member lacks: 0 counts, "skipped", NaN."""
    fill = {"status": "skipped", "steps": 0, "evaluations": 0, "diverged_at": 0}
    parts = list(members)
    names = {name for part in parts for name in part.data_vars}
    filling = {name: fill.get(str(name), np.nan) for name in names}
    return xr.concat(
        parts, dimension, data_vars="all", coords=[dimension, *(["label"] if dimension == "integrator" else [])],
        compat="override", join="outer", fill_value=filling, combine_attrs="override",
    )  # fmt: skip


def harmonic_terms(methods: Sequence[str]) -> xr.Dataset:
    """Position error terms kappa over (integrator, first, order), as far as each composition's stages reach."""
    from nearharmonic.decomposition import kappa, lambda_max

    roles = ("drift", "kick")
    reach = {(name, first): lambda_max(name, first=first) for name in methods for first in roles}  # type: ignore[arg-type]
    highest = max(reach.values())
    values = np.full((len(methods), len(roles), highest), np.nan)
    for i, name in enumerate(methods):
        for j, first in enumerate(roles):
            terms = kappa(name, reach[name, first], first=first)  # type: ignore[arg-type]
            values[i, j, : len(terms)] = [float(term) for term in terms]
    text = "position error term kappa of the harmonic oscillator; kick first is BAB, drift first is ABA"
    described = {"units": "1", "long_name": text}
    return xr.Dataset(
        {"kappa": (("integrator", "first", "order"), values, described)},
        coords={
            "integrator": ("integrator", list(methods), {"units": "1", "long_name": "integrator"}),
            "label": (
                "integrator",
                [integrators[name].label for name in methods],
                {"units": "1", "long_name": "name in the paper"},
            ),
            "first": ("first", list(roles), {"units": "1", "long_name": "operator that comes first"}),
            "order": ("order", np.arange(1, highest + 1), {"units": "1", "long_name": "order lambda in tau"}),
        },
    )
