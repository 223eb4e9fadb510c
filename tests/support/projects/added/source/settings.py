"""Settings of the steps."""

from __future__ import annotations

from dataclasses import dataclass

from nearharmonic_paper.entries import STRICT, setting, whole_from


@dataclass(frozen=True, kw_only=True)
class AddedSettings:
    """Step sizes of the experiment."""

    __pydantic_config__ = STRICT

    steps: int = setting("Step sizes: 1/2, 1/4 and so on", default=8, **whole_from(2))
