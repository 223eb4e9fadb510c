"""Members of families of methods for tests."""

import numpy as np

from nearharmonic.training.family import Family

#: One of each kind: plain and with squares, both roles, odd and even numbers of stages, all kinds of conditions.
FAMILIES = (
    Family(stages=5, first="kick"),
    Family(stages=6, first="drift"),
    Family(stages=8, first="kick", harmonic_order=7),
    Family(stages=9, first="drift", harmonic_order=8),
    Family(stages=9, first="drift", order=6),
    Family(stages=12, first="kick", order=6, harmonic_order=7),
    Family(stages=9, first="kick", generalised_order=(8, 4)),
    Family(stages=9, first="drift", generalised_order=(8, 6, 4)),
    Family(stages=2, first="kick", squares=(0, 1)),
    Family(stages=3, first="drift", squares=(1,)),
    Family(stages=5, first="drift", order=6, squares=(0, 1, 2)),
    Family(stages=6, first="kick", order=6, harmonic_order=7, squares=(0, 1, 3)),
)


def members(family, count, seed=1):
    """``count`` members (count, n), from random points."""
    random = np.random.default_rng([seed, family.stages])
    points = random.normal(1 / family.stages, 1 / family.stages, (400 * count, family.unknowns))
    points[:, family.stages - 1 :] *= 1 / family.stages**2
    found, inside = family.project(points)
    small = np.abs(found).sum(axis=1) < 4
    assert (inside & small).sum() >= count, family
    return found[inside & small][:count]
