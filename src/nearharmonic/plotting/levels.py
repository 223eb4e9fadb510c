"""Levels in printed and interactive figures, separate from matplotlib, which is slow to load."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from typing import Any

#: Upper end of the axis: an error of ten times the energy belongs to a diverged run.
LARGEST_ERROR = 10.0

#: An error term below this level is zero to the digits of the coefficients; terms of fewer digits are exactly 0.
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
        ``long_name`` and ``units`` of the errors; without these attributes errors are relative to |H0|.
    absolute, relative : str
        Symbols of |H - H0| and of |H - H0|/|H0|.
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


def arcseconds_per_century(orbital_period: float) -> float:
    """Return 1 rad per orbit in arcseconds per century, for a period in hours."""
    return _ARCSECONDS_PER_RADIAN * _HOURS_PER_CENTURY / orbital_period
