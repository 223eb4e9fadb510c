"""Arrays of an inner kernel whose lanes all hold the same run."""

from __future__ import annotations

import numpy as np

from nearharmonic.core.layout import ENERGY, LIMIT, TALLY, running_at, running_rows
from nearharmonic.numerics.portable import Floats


def lane_rows(start: Floats, parameters: Floats, width: int) -> Floats:
    """Return the rows of a kernel (flat) whose lanes all hold one start, with H0 = 1 and no limit of the energy error.

    Parameters
    ----------
    start, parameters : arrays of float
        As ``start_row`` and ``parameter_row`` lay them out.
    width : int
        Number of lanes.
    """
    d, behind = start.size // 4, start.size + TALLY
    running = running_at(d, parameters.size // 2)
    rows = np.zeros((running + running_rows(d), width))
    rows[: start.size] = rows[running : running + start.size] = start[:, None]
    rows[start.size + ENERGY], rows[start.size + LIMIT] = 1.0, np.inf
    rows[behind : behind + parameters.size] = parameters[:, None]
    return rows.ravel()


def lanes_of(row: Floats, width: int) -> Floats:
    """Return the moves (s + 2, COLUMNS) of one step size for every lane, flat."""
    return np.repeat(row, width, axis=-1).reshape(-1)
