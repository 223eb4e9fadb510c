"""Declared figures on the page: their order, ids and pages of their own; read while the workflow is parsed."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from nearharmonic_paper.tasks.declarations import Figure

#: Experiment of the figures that may have interactive panels.
PAPER = "paper"
#: Interactive figures of other quantities than energy errors.
OTHERS = ("fig2_decomposition", "fig4_perihelion", "fig6_substeps")


def number_of(figure: Figure) -> int | None:
    """Return the number of a figure in the paper, None if it has none."""
    digits = figure.target.removeprefix("fig")
    return int(digits) if digits.isdigit() else None


def anchor_of(figure: Figure) -> str:
    """Return the id of a figure."""
    return f"figure-{number_of(figure) or figure.stem}"


def in_order(figures: Iterable[Figure]) -> list[Figure]:
    """Return each figure once: energy errors of the config's own systems, numbered figures, and others."""
    drawn = list(figures)
    numbered = {one.cube for one in drawn if one.profile and number_of(one)}  # one drawing with two names
    distinct = {one.stem: one for one in drawn if number_of(one) or not (one.profile and one.cube in numbered)}.values()
    return sorted(distinct, key=lambda one: (number_of(one) or (0 if one.profile else inf), one.stem))


def is_interactive(figure: Figure) -> bool:
    """Return True if a figure has interactive panels."""
    return figure.experiment == PAPER and (figure.profile or figure.stem in OTHERS)


def pages_alone(figures: Iterable[Figure]) -> dict[str, str]:
    """Return the files of the pages that hold one interactive figure each, by the names of their outputs."""
    anchors = [anchor_of(one) for one in in_order(figures) if is_interactive(one)]
    return {anchor.replace("-", "_").replace(".", "_"): f"{anchor}.html" for anchor in anchors}
