"""Tables of places: neighbouring places are loaded as a block, any others are looked up one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.int64]

#: Number of repetitions in SIMD lanes: the doubles of the widest registers. The order of sums depends on it, so it is
#: the same on every processor.
BLOCK = 8
#: Largest number of runs of neighbouring places with a loop each; if there are more, all places are looked up.
MOST_RUNS = 4


def runs(columns: Sequence[Places], count: int) -> Iterator[slice | Places]:
    """Yield the parts of ``count`` rows: runs in which each column is constant or ascends by 1, and the other rows.

    There are at most :data:`MOST_RUNS` runs, each of at least :data:`BLOCK` rows.
    """
    steps = np.stack([np.diff(column) for column in columns], axis=1) if columns else np.zeros((count - 1, 0))
    regular = np.all(np.isin(steps, (0, 1)), axis=1)
    alike = np.all(steps[1:] == steps[:-1], axis=1)
    found: list[slice] = []
    start = 0
    while start < len(regular):
        end = start
        if regular[start]:
            while end < len(alike) and alike[end]:
                end += 1
            if end + 2 - start >= BLOCK:
                found.append(slice(start, end + 2))
                start = end + 1
        start = max(start, end) + 1
    if len(found) > MOST_RUNS:
        found = []
    yield from found
    left = np.ones(count, bool)
    for run in found:
        left[run] = False
    if left.any():
        yield np.flatnonzero(left)
