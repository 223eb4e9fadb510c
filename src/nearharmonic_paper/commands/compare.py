"""``nearharmonic compare``: differences between two results."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import asdict
from math import isnan
from typing import TYPE_CHECKING, Any

from nearharmonic.output.answers import Answer

if TYPE_CHECKING:
    from nearharmonic_paper.record.compare import Comparison, Difference

HELP = "compare two results: claims, settings, code, and every number"
HEADER = ("kind", "where", "a", "b", "unit", "relative", "at", "differ", "of")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("a", help="folder of a result, or its name below results/")
    parser.add_argument("b", help="the other result")
    parser.add_argument("--figure", metavar="FILE", help="draw the energy errors of both: a .png, .svg or .pdf file")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each difference; the status is 1 if there is one."""
    from nearharmonic_paper.record.compare import compared
    from nearharmonic_paper.record.history import doubts_in
    from nearharmonic_paper.record.manifest import folder_of

    a, b = folder_of(chosen.a), folder_of(chosen.b)
    figure = None
    if chosen.figure is not None:
        from nearharmonic_paper.record.compare import save_overlay

        second = chosen.b if chosen.b != chosen.a else f"{chosen.b} (again)"  # names in a legend differ
        figure = save_overlay({chosen.a: a, second: b}, chosen.figure)
    found = compared(a, b)
    document = {
        "a": str(a),
        "b": str(b),
        "identical": found.identical,
        "same_numbers": found.same_numbers,
        "differences": [asdict(difference) for difference in found.differences],
        "left_out": found.left_out,
        "figure": None if figure is None else str(figure),
    }
    return Answer(
        header=HEADER,
        rows=[_row(difference) for difference in found.differences],
        document=document,
        status=0 if found.identical else 1,
        caption=f"a: {a}, b: {b}: {_summary(found)}",
        notes=[*_notes(found), *doubts_in(a), *doubts_in(b)],
    )


def _summary(found: Comparison) -> str:
    """Return the number of differences of each kind, and the largest relative one, in words."""
    if found.identical:
        return "identical"
    kinds = Counter(difference.kind for difference in found.differences)
    counted = ", ".join(f"{number} {kind}" for kind, number in kinds.most_common())
    told = f"{kinds.total()} differences ({counted})"
    numbers = [one for one in found.differences if one.relative is not None]
    if numbers:
        largest = max(numbers, key=lambda one: one.relative or 0.0)
        told += f"; largest relative difference {largest.relative:.2g}, {largest.where}"
    return f"the numbers are the same; {told} in what made them" if found.same_numbers else told


def _row(difference: Difference) -> tuple[Any, ...]:
    from nearharmonic_paper.record.compare import short

    at = difference.at
    places = [f"{name} {short(value)} {difference.at_units.get(name, '')}".rstrip() for name, value in at.items()]
    return (
        difference.kind,
        difference.where,
        _value(difference.a),
        _value(difference.b),
        difference.unit,
        difference.relative,
        ", ".join(places),
        difference.differ,
        difference.compared,
    )


def _value(value: Any) -> Any:
    """Return a value unchanged, but NaN as text, because a table shows NaN as a dash."""
    return "nan" if isinstance(value, float) and isnan(value) else value


def _notes(found: Comparison) -> list[str]:
    return [f"not compared, because they are measured times: {'; '.join(found.left_out)}"] if found.left_out else []
