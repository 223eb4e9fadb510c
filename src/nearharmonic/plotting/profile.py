"""Content of figures of energy errors, on paper and in a browser: curves, levels and labels, without matplotlib."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.numerics.portable import Floats

if TYPE_CHECKING:
    import xarray as xr

#: Panels of a benchmark profile: variable, and statistic.
PANELS = {"max_energy_error": "maximum", "mean_energy_error": "mean"}
#: Upper end of the axis: an error of ten times the energy belongs to a diverged run.
LARGEST_ERROR = 10.0

#: The line of the rounding of a potential is drawn if an error is at most this multiple of it.
SHOWN = 100.0
#: Columns of a figure: 0.3 mm each in a figure 7 inches wide.
COLUMNS = 500


class Line(NamedTuple):
    """The runs of one method in one precision, variables over tau_per_stage, as a curve of a figure.

    Infinite errors (diverged runs), NaN (not computed) and zeros leave gaps. ``turn`` is the index of the method and
    the number of methods, whose markers are at alternate points.
    """

    integrator: str
    label: str
    runs: xr.Dataset
    turn: tuple[int, int]
    extended: bool = False


def lines(cube: xr.Dataset, names: Iterable[str] = tuple(PANELS), columns: int = COLUMNS) -> list[Line]:
    """Return the curves of the variables ``names`` of a cube in drawing order, each as its :func:`envelope`.

    Dimensions are (integrator, tau_per_stage), optionally led by precision.
    """
    methods, shown = cube.sizes["integrator"], list(names)
    found = []
    for precision in cube["precision"].values.tolist() if "precision" in cube.dims else [""]:
        layer = cube.sel(precision=precision) if precision else cube
        for i in range(methods):
            runs = envelope(layer.isel(integrator=i), shown, columns)
            integrator, label = (str(runs[name].item()) for name in ("integrator", "label"))
            found.append(Line(integrator, label, runs, (i, methods), precision == "extended"))
    return found


def problem_of(results: xr.Dataset, unit: str = "1") -> str:
    """Return system, interval and energy of runs, as far as attributes tell; ``unit`` is that of the time."""
    try:
        settings = json.loads(results.attrs["settings"])
        t_end = {**settings.get("settings", {}), **settings.get("sweep", {})}["t_end"]
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError):
        t_end = None
    interval = "" if t_end is None else f"$t$ = {t_end}{'' if unit == '1' else f' {unit}'}"
    H0 = energy_of(results.attrs)
    return ", ".join(filter(None, (str(results.attrs.get("system_label", "")), interval, H0 and f"$H_0$ = {H0}")))


def range_of(attributes: Mapping[str, str]) -> str:
    """Return the range of the maximum of energy errors with these attributes, in words."""
    return "over the samples" if "over the samples" in attributes.get("long_name", "") else "over all steps"


def floor_near(given: Sequence[xr.Dataset], variable: str) -> float:
    """Return the highest attribute ``energy_floor`` of results, or 0 if no error ``variable`` is near it."""
    floor = max(float(one.attrs.get("energy_floor", 0)) for one in given)
    errors = np.concatenate([np.abs(np.ravel(one[variable].values)) for one in given])
    return floor if np.any((errors > 0) & (errors <= SHOWN * floor)) else 0.0


def floor_name(floor: float) -> str:
    """Return the label of the line of the rounding of a potential."""
    return f"rounding of V, {floor:.0e}"


def energy_error_label(attributes: Mapping[str, str], absolute: str, relative: str) -> str:
    """Return the label of an axis of energy errors, relative to |H0| unless their attributes say otherwise.

    ``absolute`` and ``relative`` are the symbols of |H - H0| and of |H - H0|/|H0|.
    """
    meaning = attributes.get("long_name", "|H - H0|/|H0|")
    if "p_t" in meaning:
        absolute, relative = f"{absolute} of $T + V + p_t$", f"{relative} of $T + V + p_t$"
    scale = re.search(r"\|H - H0\|/\((\S+) (.*?)\)(?: over|, |$)", meaning)
    if scale:
        return f"{absolute} relative to energy_scale {scale[1]}" + ("" if scale[2] == "1" else f", in {scale[2]}")
    if "|H - H0|/|H0|" not in meaning:
        return f"{absolute} ({attributes.get('units', '1')})"
    return f"{relative}, or {absolute} where H0 = 0" if "where H0 = 0" in meaning else relative


def energy_of(attributes: Mapping[str, Any]) -> str:
    """Return the energy at the start with its unit, "" if the attributes of a cube have none."""
    if "energy_at_start" not in attributes:
        return ""
    unit = attributes.get("energy_unit", "1")
    return f"{float(attributes['energy_at_start']):.6g}" + ("" if unit == "1" else f" {unit}")


def envelope(curve: xr.Dataset, names: Iterable[str], columns: int = COLUMNS) -> xr.Dataset:
    """Return the points of a curve that determine its drawing against a logarithmic step size.

    Of each of ``columns`` of equal width in the logarithm they are, for each variable in ``names``, the first, last,
    lowest and highest number, and the first and last point without a number. A curve of fewer than four points a column
    is returned as it is.
    """
    if curve.sizes["tau_per_stage"] <= 4 * columns:
        return curve
    place = np.log(curve["tau_per_stage"].values)
    edges = np.searchsorted(place, np.linspace(place[0], place[-1], columns + 1)[1:-1])
    kept = {index for name in names for index in _extremes(curve[name].values, [0, *edges.tolist(), place.size])}
    return curve.isel(tau_per_stage=sorted(kept))


def _extremes(values: Floats, edges: list[int]) -> Iterator[int]:
    """Yield the indices of first, last, lowest and highest number and of first and last gap in each column."""
    drawable = np.isfinite(values)
    for begin, end in pairwise(edges):
        for among in (drawable[begin:end], ~drawable[begin:end]):
            there: Any = begin + np.flatnonzero(among)
            if there.size:
                yield from (int(there[0]), int(there[-1]))
        there = begin + np.flatnonzero(drawable[begin:end])
        if there.size:
            yield from (int(there[values[there].argmin()]), int(there[values[there].argmax()]))
