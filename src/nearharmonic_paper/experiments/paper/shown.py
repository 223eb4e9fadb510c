"""Content of Figures 2 and 4, on paper and in a browser, without matplotlib."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.output.store import double_runs
from nearharmonic.plotting.profile import Line, lines

if TYPE_CHECKING:
    import xarray as xr

#: An error term below this level is zero to the digits of the coefficients; terms of fewer digits are exactly 0.
SATISFIED_BELOW = 1e-30
#: Arcseconds per century, from general relativity: Nobili & Will (1986), doi:10.1038/320039a0.
MERCURY_RELATIVISTIC_ADVANCE = 42.98


def arcseconds_per_century(orbital_period: float) -> float:
    """Return 1 rad per orbit in arcseconds per century, for a period in hours."""
    return (180 * 3600 / pi) * (36525 * 24) / orbital_period


class Advances(NamedTuple):
    """Perihelion advances of the runs of one method over tau_per_stage.

    ``size`` is positive, NaN where there is none to draw; ``interval`` is the half width of its 95 % interval, which
    excludes zero where the advance is ``known``, and includes it where it is ``unknown``.
    """

    line: Line
    evaluations: Floats
    size: Floats
    interval: Floats
    known: Bools
    unknown: Bools


def advances(cube: xr.Dataset, columns: int) -> list[Advances]:
    """Return the advances of each method of ``cube`` in double, as many as ``columns`` can show."""
    found = []
    for line in lines(double_runs(cube), ["perihelion_advance"], columns):
        size: Floats = np.abs(np.array(line.runs["perihelion_advance"].values, float))
        size[~(np.isfinite(size) & (size > 0))] = np.nan
        interval = np.array(line.runs["perihelion_advance_interval"].values, float)
        evaluations = line.runs["evaluations_per_orbit"].values
        found.append(Advances(line, evaluations, size, interval, interval < size, interval >= size))
    return found
