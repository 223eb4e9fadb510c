"""Settings of a search from random points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats


@dataclass(frozen=True)
class RandomStarts:
    """Random points that a search begins from, and which of its ends count.

    Attributes
    ----------
    count : int
        Number of points.
    seed : int or tuple of int
        The same seed gives the same points.
    box : float
        Unknowns, which are pure numbers, start uniformly in [-box, box].
    bound : float
        Solutions with an unknown beyond it in absolute value are dropped.
    same : float
        Solutions whose unknowns differ by less are one. Newton's method leaves about 1e-12, and distinct isolated
        solutions lie 1e-2 apart.

    Raises
    ------
    SettingError
        ``count`` is no integer >= 1.
    """

    count: int
    seed: int | tuple[int, ...]
    box: float = 1.0
    bound: float = 10.0
    same: float = 1e-6

    def __post_init__(self) -> None:
        count: Any = self.count  # a user may pass anything
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise bad_setting("starts", count, "an integer >= 1")

    def generator(self) -> np.random.Generator:
        """Return the generator of the points, and of what else a search draws."""
        return np.random.default_rng(self.seed)

    def points(self, generator: np.random.Generator, unknowns: int, most: int | None = None) -> Floats:
        """Return the next points (start, unknown), all or ``most`` of them."""
        return generator.uniform(-self.box, self.box, (most or self.count, unknowns))
