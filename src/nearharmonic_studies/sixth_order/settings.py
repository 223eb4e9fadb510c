"""Settings of the search for methods of order six: its effort."""

from __future__ import annotations

from dataclasses import dataclass

from nearharmonic_paper.entries import STRICT, setting, whole_from


@dataclass(frozen=True, kw_only=True)
class SixthOrderSettings:
    """Effort of the search for methods of order six with a harmonic order."""

    __pydantic_config__ = STRICT

    seed: int = setting(
        "Seed of all random starts and walks; the same seed gives the same tables", default=1, **whole_from(0)
    )
    starts: int = setting(
        "Random starts for each number of stages and each composition", default=4000, **whole_from(1, 10**7)
    )
    walks: int = setting("Walks along each family, from its best members", default=48, **whole_from(1, 10**6))
    walk_steps: int = setting("Steps of each walk", default=2500, **whole_from(1, 10**6))
