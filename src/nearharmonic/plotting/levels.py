"""Levels that the printed and the interactive figures draw, apart from matplotlib, which is slow to load."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi

#: An error of ten times the energy is no trajectory any more; the axis ends there.
LARGEST_ERROR = 10.0

#: An error term below this is an order condition met to the digits of the coefficients: the least exact ones carry 39.
SATISFIED_BELOW = 1e-30

#: Arcseconds per century, from general relativity: Nobili & Will (1986), doi:10.1038/320039a0.
MERCURY_RELATIVISTIC_ADVANCE = 42.98

_ARCSECONDS_PER_RADIAN = 180 * 3600 / pi
_HOURS_PER_CENTURY = 36525 * 24


def energy_error_label(attributes: Mapping[str, str], absolute: str, relative: str) -> str:
    """Return the label of an axis of energy errors, relative to |H0| unless their attributes say otherwise.

    Parameters
    ----------
    attributes : mapping
        ``long_name`` and ``units`` of the errors; without them, they are relative to |H0|.
    absolute, relative : str
        What stands for |H - H0| and for |H - H0|/|H0|.
    """
    meaning = attributes.get("long_name", "|H - H0|/|H0|")
    scale = re.search(r"\|H - H0\|/\((\S+) (.*?)\)(?: over|, |$)", meaning)
    if scale:
        return f"{absolute} relative to energy_scale {scale[1]}" + ("" if scale[2] == "1" else f", in {scale[2]}")
    if "|H - H0|/|H0|" not in meaning:
        return f"{absolute} ({attributes.get('units', '1')})"
    return f"{relative}, or {absolute} where H0 = 0" if "where H0 = 0" in meaning else relative


def arcseconds_per_century(orbital_period: float) -> float:
    """Return what 1 rad per orbit is in arcseconds per century, for a period in hours."""
    return _ARCSECONDS_PER_RADIAN * _HOURS_PER_CENTURY / orbital_period
