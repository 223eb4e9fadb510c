"""Cubes and tables of the stress tests: reductions of the runs of all methods, and exact linear stability.

A reduction takes an ``xarray.Dataset`` of all methods and returns numbers for the cube, under the name of its function.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nearharmonic.exact.polynomials import significant
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp, log
from nearharmonic.numerics.portable import Floats, dot, jackknife_interval, line_fit, mean, norms
from nearharmonic.output.store import coordinate, described, method_coordinates, read, variable
from nearharmonic.output.table import Table
from nearharmonic.systems.kepler import perihelion_angle
from nearharmonic.systems.relativistic_oscillator import SYSTEM
from nearharmonic.theory import oscillator
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings, MapSettings, RoundingSettings
from nearharmonic_paper.tasks.reduction import Reductions

# --- Exact linear stability of each method: the trace of the oscillator's step matrix, and the gaps.

#: Largest step size per stage of the curve, above the last stable step size of all ten methods, and number of points.
HIGHEST_TAU_PER_STAGE, POINTS = 2.4, 961


def linear(integrators: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` of the methods with the names ``integrators``, and its ``table``."""
    methods = [registry[name] for name in integrators]
    return {"cube": linear_stability_cube(methods), "table": linear_stability_table(methods)}


def linear_stability_cube(tableaus: Sequence[Tableau]) -> xr.Dataset:
    """Return half the trace over (integrator, tau_per_stage), and the gaps over (integrator, gap).

    Gaps are NaN after the last gap of a method, which ends at infinity.
    """
    grid = np.linspace(0, HIGHEST_TAU_PER_STAGE, POINTS)
    gaps = [oscillator.stability_gaps(tableau) for tableau in tableaus]
    edges = np.full((2, len(tableaus), max(map(len, gaps))), np.nan)
    growth = np.full((2, *edges.shape[1:]), np.nan)
    trace = np.empty((len(tableaus), POINTS))
    for i, tableau in enumerate(tableaus):
        K = oscillator.step_polynomials(tableau)
        halved = [float(a + b) / 2 for a, b in zip(K.K11, K.K22, strict=True)]
        trace[i] = np.polynomial.polynomial.polyval(grid * tableau.stages, halved)
        for j, gap in enumerate(gaps[i]):
            edges[:, i, j] = [float(edge) for edge in gap]
            largest = oscillator.largest_growth(tableau, gap)
            growth[:, i, j] = float(largest.per_step), float(largest.per_time)
    over = ("integrator", "gap")
    return xr.Dataset(
        {
            "half_trace": variable(("integrator", "tau_per_stage"), trace, "half the trace of the step matrix"),
            "start": variable(over, edges[0], "gap opens"),
            "end": variable(over, edges[1], "gap closes"),
            "growth_per_step": variable(over, growth[0], "largest Lyapunov exponent per step"),
            "growth_per_time": variable(over, growth[1], "largest Lyapunov exponent per time"),
        },
        coords={
            **method_coordinates(tableaus),
            "stages": variable("integrator", [t.stages for t in tableaus], "stages"),
            **coordinate("tau_per_stage", grid, "step size per stage"),
            **coordinate("gap", np.arange(edges.shape[2]), "number of the gap"),
        },
    )


#: Significant digits of the edges.
DIGITS = 13

#: First edges from another program, in C doubles by bisection of the trace: 10 digits.
KNOWN_LIMITS: Mapping[str, str] = {
    "ruth": "1.573401947",
    "s5odr4": "2.720974539",
    "aba104": "3.089617987",
    "aba864": "3.142177180",
    "aba1064": "3.146107336",
    "yoshida_s7o6a": "2.269057996",
    "abas5o6h": "3.069226671",
    "babs7o7h": "3.140769602",
    "babps8o7h": "3.139720728",
    "babps9o7h": "3.140827789",
}


def linear_stability_table(tableaus: Sequence[Tableau]) -> Table:
    """Return a row for each interval of stability of each method and the gap that ends it, edges as decimal strings."""
    header = (
        "integrator", "stages", "stable from", "stable to", "stable to, per stage", "known limit", "unstable to",
        "largest growth per step", "at step size", "largest growth per time", "trace touches 2 at",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for tableau in tableaus:
        touching, known, before = oscillator.touching_points(tableau), KNOWN_LIMITS.get(tableau.name, ""), 0
        for gap in oscillator.stability_gaps(tableau):
            growth, (start, end) = oscillator.largest_growth(tableau, gap), gap
            touched = " ".join(significant(x, DIGITS) for x in touching if before < x < start)
            edges = [significant(x, DIGITS) for x in (before, start, start / tableau.stages, end)]
            sizes = *edges[:3], known, edges[3]
            rates = float(growth.per_step), float(growth.at), float(growth.per_time)
            rows.append((tableau.name, tableau.stages, *sizes, *rates, touched))
            known, before = "", end
    caption = "Intervals of step sizes in which the harmonic oscillator stays bounded, and the gap that ends each."
    return Table(header=header, rows=rows, caption=caption)


# --- What the reductions share.


def stacked(names: Sequence[str], runs: Iterable[xr.Dataset]) -> xr.Dataset:
    """Return the runs of each of the methods ``names`` along a new dimension ``integrator``, without attributes."""
    cube = xr.concat(list(runs), "integrator", combine_attrs="override", data_vars="all", coords="all")
    cube.attrs = {}
    return cube.assign_coords(method_coordinates([registry[name] for name in names]))


def _described(values: Any, text: str, units: str = "1") -> xr.DataArray:
    result: xr.DataArray = values.assign_attrs(described(text, units))
    return result


# --- Henon-Heiles ensembles: ``escaped`` over (integrator, energy, tau_per_stage), ``energy_error`` over quantile too.
#
# These two are distributions over the trajectories, taken in the jobs that integrate: the errors of all trajectories
# would be 34 MB a method.

OF_ENSEMBLES = Reductions()

#: A step size is trusted if at most this fraction of trajectories escapes.
TOLERATED = 0.01


@OF_ENSEMBLES("escaped", over="tau_per_stage")
def trusted_up_to(cube: xr.Dataset) -> xr.DataArray:
    """Largest step size per stage up to which, over the grid, no more than :data:`TOLERATED` escapes; NaN if none."""
    kept = (cube.escaped <= TOLERATED).cumulative("tau_per_stage").min().astype(bool)
    limit = cube.tau_per_stage.where(kept).max("tau_per_stage")
    return _described(limit, f"largest step size per stage up to which at most {TOLERATED:g} escapes")


@OF_ENSEMBLES("integrator", over="tau_per_stage")
def linear_limit(cube: xr.Dataset) -> xr.DataArray:
    """Step size per stage at which the harmonic oscillator is first unstable."""
    methods = [registry[name] for name in cube.integrator.values]
    limits = [float(oscillator.stability_limit(method)) / method.stages for method in methods]
    text = "step size per stage at which the harmonic oscillator is first unstable"
    return _described(cube.integrator.copy(data=limits), text)


def henon_heiles_table(cube: xr.Dataset) -> Table:
    """Return a row for each method and energy surface: the largest trusted step size and the errors there."""
    header = [
        "integrator", "energy", "linear_limit_tau_per_stage", f"tau_per_stage_escaped_up_to_{TOLERATED:g}",
        "median_energy_error_there", "worst_energy_error_there", "share_of_linear_limit",
    ]  # fmt: skip
    rows: list[list[Any]] = []
    for name, energy in product(cube.integrator.values, cube.energy.values):
        one = cube.sel(integrator=name, energy=energy)
        limit, trusted = one.linear_limit.item(), one.trusted_up_to.item()
        errors = [np.nan, np.nan]
        if np.isfinite(trusted):
            errors = [one.energy_error.sel(tau_per_stage=trusted, quantile=q).item() for q in (0.5, 1.0)]
        rows.append([str(name), float(energy), limit, trusted, *errors, trusted / limit])
    caption = f"Hénon-Heiles ensembles: largest tau/s up to which at most {TOLERATED:.0%} of the trajectories escape."
    return Table(header=header, rows=rows, caption=caption)


def henon_heiles(integrators: Sequence[str], settings: EnsembleSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = henon_heiles_cube(stacked(integrators, (read(runs[name]) for name in integrators)))
    return {"cube": cube, "table": henon_heiles_table(cube)}


def henon_heiles_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return maps over (integrator, energy, tau_per_stage), and their reductions."""
    return runs.assign(OF_ENSEMBLES.of(runs, over="tau_per_stage"))


# --- Kepler maps: ``q`` and ``p``, once a period, over (integrator, tau_per_stage, eccentricity, sample, component).
#
# What the cube takes over is over the first three. With ``over="tau_per_stage"`` a reduction takes whole curves of the
# cube instead.

OF_MAPS = Reductions()

#: Energy error of the contour in figure and table.
CONTOUR = 1e-6


@OF_MAPS("steps_per_orbit")
def evaluations_per_orbit(runs: xr.Dataset) -> xr.DataArray:
    """Force evaluations in one period of the exact orbit."""
    stages = runs.integrator.copy(data=[registry[name].stages for name in runs.integrator.values])
    return _described(runs.steps_per_orbit * stages, "force evaluations per orbit")


@OF_MAPS("q", "p", "energy_error")
def perihelion_advance(runs: xr.Dataset) -> xr.DataArray:
    """Rotation of the Laplace-Runge-Lenz vector per orbit; NaN for lost orbits and for circles."""
    advance = xr.apply_ufunc(rotation_per_sample, runs.q, runs.p, input_core_dims=[["sample", "component"]] * 2)
    advance = advance.where(np.isfinite(runs.energy_error) & (runs.eccentricity > 0))
    return _described(advance, "rotation of the Laplace-Runge-Lenz vector per orbit", "rad")


@OF_MAPS("evaluations_per_orbit", "energy_error", over="tau_per_stage")
def evaluations_for_contour(cube: xr.Dataset) -> xr.DataArray:
    """Force evaluations per orbit from which on the energy error stays below :data:`CONTOUR`."""
    contour = xr.apply_ufunc(
        evaluations_below, cube.evaluations_per_orbit, cube.energy_error, kwargs={"level": CONTOUR},
        input_core_dims=[["tau_per_stage"]] * 2, vectorize=True,
    )  # fmt: skip
    return _described(contour, f"force evaluations per orbit from which on the energy error stays below {CONTOUR:g}")


def rotation_per_sample(q: Floats, p: Floats) -> Floats:
    """Return the mean rotation per sample (rad) of the Laplace-Runge-Lenz vector of orbits, by least squares.

    ``q``, ``p`` (..., samples, 2): states of each orbit. The result (...) is NaN if a sample is missing, or if the
    vector rotates by more than a quarter turn between two samples, so that the sense of rotation is ambiguous.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = perihelion_angle((q[..., 0], q[..., 1]), (p[..., 0], p[..., 1]), 1.0)
    turns = np.diff(angle)
    turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
    turns[np.abs(turns) > np.pi / 2] = np.nan
    path = np.concatenate([np.zeros_like(turns[..., :1]), np.cumsum(turns, axis=-1)], axis=-1)
    index = np.arange(path.shape[-1]) - (path.shape[-1] - 1) / 2
    return np.apply_along_axis(dot, -1, path, index) / dot(index, index)


def evaluations_below(evaluations: NDArray[Any], error: Floats, level: float) -> float:
    """Return the number of evaluations from which on an error stays below ``level``.

    ``evaluations`` (n,): ascending; neighbours may be equal if their errors are. ``error`` (n,): NaN without a run,
    which counts as below. It is interpolated in the logarithms; NaN if the last error is not below.
    """
    above = np.flatnonzero(error >= level)
    last = above[-1] if above.size else len(evaluations)
    if last + 1 >= len(evaluations):
        return np.nan
    (x0, x1), (y0, y1) = log(evaluations[last : last + 2].astype(float)), log(error[last : last + 2])
    inside = np.isfinite([y0, y1]).all()
    return float(exp(x0 + (x1 - x0) * (y0 - log(level)) / (y0 - y1)) if inside else exp(x1))


#: Eccentricities of the table; the nearest value of the grid is used.
TABULATED = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99)


def kepler_table(cube: xr.Dataset) -> Table:
    """Return a row for each method: force evaluations per orbit for the error of the contour at some eccentricities."""
    nearest = cube.get_index("eccentricity").get_indexer(TABULATED, method="nearest")
    shown = cube.evaluations_for_contour.isel(eccentricity=np.unique(nearest))  # a coarse grid has one for several
    return Table(
        header=["integrator", *(f"e_{e:.3f}" for e in shown.eccentricity.values)],
        rows=[[str(name), *map(float, shown.sel(integrator=name).values)] for name in cube.integrator.values],
        caption=f"Kepler orbits: force evaluations per orbit above which the energy error stays below {CONTOUR:g}.",
    )


def kepler(integrators: Sequence[str], settings: MapSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = kepler_cube(stacked(integrators, (read(runs[name]) for name in integrators)))
    return {"cube": cube, "table": kepler_table(cube)}


def kepler_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return maps over (integrator, tau_per_stage, eccentricity) without the states, and their reductions."""
    cube = runs.drop_dims(["sample", "component"]).assign(OF_MAPS.of(runs))
    return cube.assign(OF_MAPS.of(cube, over="tau_per_stage"))


# --- Errors by rounding: ``energy_error`` and ``lag`` over (integrator, source, orbit, sample), and ``time`` over
# (integrator, sample).

OF_ROUNDING = Reductions()

QUANTITIES = {"energy_error": "energy error", "lag": "lag along the track"}


@OF_ROUNDING(*QUANTITIES, "time", over="orbit")
def growth_of_rounding(cube: xr.Dataset) -> xr.Dataset:
    """Four numbers of each quantity, over the orbits.

    They are the root mean square at each sample, ``<quantity>_rms``, its power law in time, ``<quantity>_exponent`` and
    ``<quantity>_interval``, and the absolute mean at the last sample, ``<quantity>_bias``.
    """
    found = xr.Dataset()
    for name, text in QUANTITIES.items():
        error, unit = cube[name], cube[name].attrs["units"]
        exponent, interval = xr.apply_ufunc(
            growth_exponent, error, cube.time, input_core_dims=[["orbit", "sample"], ["sample"]],
            output_core_dims=[[], []], vectorize=True,
        )  # fmt: skip
        rms = xr.apply_ufunc(np.sqrt, (error * error).mean("orbit"))
        bias = abs(error.reset_coords(drop=True).isel(sample=-1, drop=True).mean("orbit", skipna=False))
        for kind, values, meaning, units in (
            ("rms", rms, f"root mean square of the {text} over the orbits", unit),
            ("exponent", exponent, f"exponent of the growth of the {text}", "1"),
            ("interval", interval, f"half width of the 95 % interval of the exponent of the {text}", "1"),
            ("bias", bias, f"absolute mean of the {text} over the orbits at the end", unit),
        ):
            found[f"{name}_{kind}"] = _described(values, meaning, units)
    return found


def growth_exponent(errors: Floats, time: Floats) -> tuple[float, float]:
    """Return the exponent of a power law in time (t,) of the root mean square of errors (orbits, t), and its interval.

    That is the slope of log rms against log time, and the half width of its 95 % interval by the jackknife over orbits,
    because the times of one orbit are not independent.
    """
    squares, x = errors * errors, log(time)
    x = x - mean(x)

    def slope(rms: Floats) -> Floats:
        return np.array([dot(row, x) for row in log(rms)]) / dot(x, x)

    n = len(errors)
    total = squares.sum(axis=0)
    exponent = float(slope(np.sqrt(total / n)[None])[0])
    return exponent, jackknife_interval(slope(np.sqrt((total - squares) / (n - 1))))


#: Exponents of independent errors, by quantity (Brouwer 1937, doi:10.1086/105423).
BROUWER = {"energy_error": 0.5, "lag": 1.5}


def rounding_table(cube: xr.Dataset) -> Table:
    """Return a row for each method, arithmetic and quantity: power law, Brouwer's, and bias relative to rms."""
    header = ["integrator", "source", "quantity", "exponent", "interval_95", "brouwer", "rms_at_end", "bias_over_rms"]
    rows: list[list[Any]] = []
    for name, source, quantity in product(cube.integrator.values, cube.source.values, BROUWER):
        one = cube.sel(integrator=name, source=source)
        rms = one[f"{quantity}_rms"].values[-1]
        law = [one[f"{quantity}_{key}"].item() for key in ("exponent", "interval")]
        # The error due to rounded coefficients is no random walk.
        brouwer = "" if source == "coefficients" else BROUWER[quantity]
        bias = one[f"{quantity}_bias"].item() / rms
        rows.append([str(name), str(source), quantity, *law, brouwer, float(rms), bias])
    caption = "Growth of round-off along Kepler orbits, against time: energy over |H0|, and lag in mean anomaly (rad)."
    return Table(header=header, rows=rows, caption=caption)


def rounding(integrators: Sequence[str], settings: RoundingSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = rounding_cube(stacked(integrators, (read(runs[name]) for name in integrators)))
    return {"cube": cube, "table": rounding_table(cube)}


def rounding_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return errors over (integrator, source, orbit, sample), and their reductions."""
    return runs.assign(OF_ROUNDING.of(runs, over="orbit"))


# --- Errors by amplitude: ``max_energy_error`` over (roles, amplitude, integrator, tau_per_stage).

OF_KINETIC_ENERGY = Reductions()

#: Step size per stage of the comparison: errors are far above rounding, and all step-size resonances are at larger
#: steps.
COMPARED_AT = 0.05
#: Reference method.
YARDSTICK = "ruth"


@OF_KINETIC_ENERGY("max_energy_error", over="tau_per_stage")
def relative_error(runs: xr.Dataset) -> xr.DataArray:
    """Errors over the yardstick's at the same amplitude; NaN if that is not among the methods."""
    errors = runs.max_energy_error.sel(tau_per_stage=COMPARED_AT, method="nearest", drop=True)
    yardstick = errors.reindex(integrator=[YARDSTICK]).sel(integrator=YARDSTICK, roles="own", drop=True)
    text = f"max_energy_error at tau/s = {COMPARED_AT:g} over its value for {YARDSTICK} in its own roles"
    return _described(errors / yardstick.reset_coords(drop=True), text)


def kinetic_energy_table(cube: xr.Dataset) -> Table:
    """Return a row for each method and roles: its error relative to Ruth's at each amplitude, and the decline.

    The decline is the ratio at amplitude 1, where speeds reach 0.75 of the speed of light, divided by the ratio at the
    smallest amplitude: the factor by which the advantage over Ruth's method decreases.
    """
    ratio = cube.relative_error
    amplitudes = [float(a) for a in ratio.amplitude.values]
    rows: list[tuple[Any, ...]] = []
    for name in map(str, ratio.integrator.values):
        for roles in map(str, ratio.roles.values):
            values = [float(x) for x in ratio.sel(integrator=name, roles=roles).values]
            rows.append((name, roles, *values, values[amplitudes.index(1.0)] / values[0]))
    header = ("integrator", "roles", *(f"error / Ruth's at A = {a:g}" for a in amplitudes), "decline to A = 1")
    caption = "maximum energy error at tau/s = 0.05 relative to Ruth's method, by amplitude A."
    return Table(header=header, rows=rows, caption=f"Relativistic oscillator: {caption}")


def kinetic_energy(integrators: Sequence[str], run: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; the names ``integrators`` are stored in the files."""
    cube = kinetic_energy_cube(read(run))
    return {"cube": cube, "table": kinetic_energy_table(cube)}


def kinetic_energy_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return energy errors over (roles, amplitude, integrator, tau_per_stage), and their reductions."""
    cube = runs.assign(OF_KINETIC_ENERGY.of(runs, over="tau_per_stage"))
    cube.attrs = {"system": SYSTEM.name, "system_label": SYSTEM.label, "compared_at": COMPARED_AT}
    return cube


# --- Conserved quantities: numbers measured on one system, and estimates for pure rounding errors.
#
# A step makes 2 s + 1 updates y += c tau dy/dt, each rounded by up to u = 2^-53 of y (plain summation) or of the
# increment (compensated), of either sign: N of them add up to sqrt(N) u times their root mean square as a random walk,
# and to N u times it at the worst, if all push one way. The flow carries each error on: the sums are multiplied by the
# root mean square over time of the tangent map's norm.

OF_STRUCTURE = Reductions()

#: Unit roundoff of a double, and relative error of a double-double operation (Hida, Li & Bailey 2001).
UNIT_ROUNDOFF = 2.0**-53
DOUBLE_DOUBLE_ROUNDOFF = 2.0**-104

#: Exact numbers of an array of floats.
_exact = np.frompyfunc(Fraction, 1, 1)


#: Variables of a method on a system, and their meaning. The interval of the trend assumes independent blocks: blocks
#: of a chaotic orbit are dependent, and its trend may exceed the interval two or three times.
MEASURED = {
    "growth": "root mean square over the run of the tangent map's norm",
    "return_error": "distance from the start after the run and the run back, compensated summation; NaN if asymmetric",
    "return_walk": "what rounding gives for it as a random walk",
    "return_bound": "what rounding gives for it if all errors add up",
    "plain_return_error": "distance from the start after the run and the run back, plain summation; NaN if asymmetric",
    "plain_return_walk": "what rounding gives for it as a random walk",
    "plain_return_bound": "what rounding gives for it if all errors add up",
    "symplectic_defect": "largest entry of J^T Omega J - Omega, J the tangent map of the run in double-double",
    "symplectic_walk": "what double-double rounding gives for it as a random walk",
    "energy_drift": "trend of the mean of (H - H0)/|H0| over the long run",
    "energy_drift_interval": "half width of the 95 % interval of the trend",
    "energy_walk": "what rounding gives for the energy as a random walk",
}


@OF_STRUCTURE("neighbour", "neighbour_low", "state", "state_low", "rate", "energy_error", "power")
def structure_numbers(runs: xr.Dataset) -> xr.Dataset:
    """Numbers of :data:`MEASURED` of each method on one system."""
    rows = [_numbers(runs.isel(integrator=i), registry[name]) for i, name in enumerate(runs.integrator.values)]
    columns = {name: [row[name] for row in rows] for name in MEASURED}
    return xr.Dataset(
        {key: _described(runs.integrator.copy(data=columns[key]), text) for key, text in MEASURED.items()}
    )


def _numbers(runs: xr.Dataset, tableau: Tableau) -> dict[str, float]:
    """Return the numbers of one method; the trend is a least squares line, NaN if the run left its energy surface."""
    d, steps, tau, spacing = runs.component.size // 2, *(float(x) for x in (runs.steps, runs.tau, runs.offset[2]))

    def values(name: str, **chosen: Any) -> Any:
        # Without padded samples, and in the order of C, on which the last bits of sums depend.
        column = runs[name].sel(chosen)
        kept = column.dropna("sample", how="all") if "sample" in column.dims else column
        return kept.values.copy(order="C")

    neighbours = values("neighbour")  # (axis, offset, sample, component)
    maps = ((neighbours[:, 2] - neighbours[:, 1]) / (2 * spacing)).transpose(1, 0, 2)
    found = {"growth": _rms(norms(maps.copy(order="C")))}
    squares: dict[str, float] = {}
    for prefix, summation in (("", "compensated"), ("plain_", "plain")):
        compensated = summation == "compensated"
        state = values("rate") if compensated else values("state", summation="compensated", direction="forwards").T
        each = np.array([
            (abs(float(Fraction(c))) * tau if compensated else 1) * _rms(half)
            for half, row in ((state[:d], tableau.drift), (state[d:], tableau.kick))
            for c in row
        ])  # fmt: skip
        squares[summation] = steps * d * (each**2).sum()
        error = _distance(*(values(name, summation=summation) for name in ("state", "state_low")))
        found |= {
            f"{prefix}return_error": error if tableau.symmetric else np.nan,
            f"{prefix}return_walk": UNIT_ROUNDOFF * found["growth"] * np.sqrt(2 * squares[summation]),
            f"{prefix}return_bound": UNIT_ROUNDOFF * found["growth"] * 2 * (steps * d * each.sum()),
        }
    trend = (np.arange(runs.block.size) + 0.5) / runs.block.size - 0.5
    drift, interval = line_fit(trend, values("energy_error"))
    # J enters the defect twice, and differences divide by the spacing.
    doubled = 2 * found["growth"] * found["growth"] * DOUBLE_DOUBLE_ROUNDOFF * (np.sqrt(squares["plain"]) / spacing)
    # An update rounded by u c tau (dy/dt) changes the energy by that times dH/dy: u c tau |dT/dp dV/dq| for q and p.
    coefficients = np.square([float(Fraction(c)) for c in (*tableau.drift, *tableau.kick)])
    updates = np.sqrt(float(runs.long_steps) * d)
    return found | {
        "symplectic_defect": defect(tangent_map(neighbours[..., -1, :], values("neighbour_low"), spacing)),
        "symplectic_walk": doubled,
        "energy_drift": drift,
        "energy_drift_interval": interval,
        "energy_walk": UNIT_ROUNDOFF * (tau * float(runs.power) * float(np.sqrt(np.sum(coefficients)))) * updates,
    }


def tangent_map(high: Any, low: Any, spacing: float) -> NDArray[Any]:
    """Return the derivatives (2 d, 2 d) of a state by its start, by the five-point rule in exact arithmetic.

    ``high``, ``low`` (2 d, 4, 2 d): states as pairs of doubles, from starts at -2, -1, 1 and 2
    spacings along each axis. ``spacing``: distance of neighbouring starts.
    """
    far_below, below, above, far_above = np.moveaxis(_exact(high) + _exact(low), 1, 0)
    map_: NDArray[Any] = ((8 * (above - below) - (far_above - far_below)) / (12 * Fraction(spacing))).T
    return map_


def defect(J: NDArray[Any]) -> float:
    """Return the largest entry of J^T Omega J - Omega for a matrix (2 d, 2 d) of Fraction, rounded once."""
    d = len(J) // 2
    areas = J[:d].T @ J[d:]
    omega = np.eye(2 * d, k=d, dtype=int) - np.eye(2 * d, k=-d, dtype=int)
    return float(abs(areas - areas.T - omega).max())


def _distance(state: Any, low: Any) -> float:
    """Return the largest distance of a component of states (direction, sample, 2 d) from its start, rounded once."""
    exact = _exact(state[:, [0, -1]]) + _exact(low[:, [0, -1]])
    return float(abs(exact[1, 1] - exact[0, 0]).max())


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def structure_table(cube: xr.Dataset) -> Table:
    """Return a row for each system and each method measured on it, with all variables of ``cube``."""
    keys = [str(key) for key in cube.data_vars]
    rows: list[tuple[Any, ...]] = []
    for system in map(str, cube.system.values):
        for name in map(str, cube.integrator.values):
            one = cube.sel(system=system, integrator=name)
            if np.isfinite(one.steps):
                rows.append((system, name, *(int(one[k]) if k == "steps" else float(one[k]) for k in keys)))
    return Table(
        header=("system", "integrator", *(key.replace("_", " ") for key in keys)),
        rows=rows,
        caption="Relative errors of reversibility, symplecticity and mean energy, beside the effect of rounding alone.",
    )


def structure(integrators: Sequence[str], t_end: Mapping[str, str], runs: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``, from the path of the run file of each system in the order of ``t_end``."""
    cube = structure_cube([registry[name] for name in integrators], dict(zip(t_end, map(read, runs), strict=True)))
    return {"cube": cube, "table": structure_table(cube)}


def structure_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the reductions of the runs on each system over (system, integrator), NaN where a method does not fit."""
    axes = {**coordinate("system", list(runs), "system"), **method_coordinates(methods)}
    parts = [
        one[["tau_per_stage", "steps"]].assign(OF_STRUCTURE.of(one)).reindex(integrator=axes["integrator"][1])
        for one in runs.values()
    ]
    joined = xr.concat(parts, "system", combine_attrs="override")
    return xr.Dataset({name: joined[name].variable for name in joined.data_vars}, axes)
