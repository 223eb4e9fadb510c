"""Levels that the printed and the interactive figures draw, apart from matplotlib, which is slow to load."""

from __future__ import annotations

from math import pi

#: An error of ten times the energy is no trajectory any more; the axis ends there.
LARGEST_ERROR = 10.0

#: An error term below this is an order condition met to the digits of the coefficients: the least exact ones carry 39.
SATISFIED_BELOW = 1e-30

#: Arcseconds per century, from general relativity: Nobili & Will (1986), doi:10.1038/320039a0.
MERCURY_RELATIVISTIC_ADVANCE = 42.98

_ARCSECONDS_PER_RADIAN = 180 * 3600 / pi
_HOURS_PER_CENTURY = 36525 * 24


def arcseconds_per_century(orbital_period: float) -> float:
    """Return what 1 rad per orbit is in arcseconds per century, for a period in hours."""
    return _ARCSECONDS_PER_RADIAN * _HOURS_PER_CENTURY / orbital_period
