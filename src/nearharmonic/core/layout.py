"""How a kernel's arrays are laid out; known to those who call kernels and to those who compile them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Entries of the tally behind the 4 d rows of the state, in this order.
WORST, TOTAL, TOTAL_CARRY, LATEST, ENERGY, ENERGY_LOW, LIMIT = range(7)
TALLY = 7

#: More steps than any run has.
FAR = np.iinfo(np.int64).max


def workspace(size: int, parts: int, width: int, stages: int) -> tuple[NDArray[Any], ...]:
    """The flat arrays that ``run`` works in: two row blocks, drifts, kicks; and per lane its run, step and sample."""
    rows = (size + TALLY) * width
    coefficients = (stages + 1) * parts * width
    floats = tuple(np.zeros(n) for n in (rows, rows, coefficients, coefficients))
    return (*floats, *(np.zeros(width, np.int64) for _ in range(3)))
