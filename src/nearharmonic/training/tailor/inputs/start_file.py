"""Files of starts: one line per start, with the positions and then the momenta."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import decimal_of

#: Minimum number of starts: four for the search, and four for the test.
FEWEST = 8


def read_starts(place: str | os.PathLike[str], dimension: int) -> Floats:
    """Return the starts (R, 2 d) of a CSV file.

    Parameters
    ----------
    place : path
        The file, with 2 d numbers per line: d positions and d momenta. Its first line may be a header; ``#`` begins a
        comment.
    dimension : int
        Coordinates d.

    Raises
    ------
    SettingError
        The file cannot be read, a line has no 2 d finite numbers, or there are fewer than :data:`FEWEST`.
    """
    path = Path(place)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text in UTF-8"
        raise bad_setting("starts", str(path), f"a file that can be read: {reason}") from None
    rows: list[list[float]] = []
    header = True
    for number, line in enumerate(lines, start=1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        cells = text.split(",")
        try:
            rows.append(_row(cells, dimension))
        except ValueError as fault:
            if not (header and not rows and _is_header(cells)):
                raise SettingError(f"{path}, line {number}: {fault}") from None
        header = False
    found = np.array(rows).reshape(-1, 2 * dimension)
    least_starts("starts", str(path), found, dimension)
    return found


def least_starts(key: str, given: object, rows: Floats, dimension: int) -> None:
    """Raise an error for too few starts, another number of coordinates, or numbers that are not finite."""
    wanted = f"{2 * dimension} finite numbers a start, {dimension} positions and {dimension} momenta"
    if rows.ndim != 2 or rows.shape[1] != 2 * dimension or not np.isfinite(rows).all():
        raise bad_setting(key, given, wanted)
    if len(rows) < FEWEST:
        what = f"at least {FEWEST} starts, and there are {len(rows)}: half of them are kept for the test"
        raise bad_setting(key, given, what)


def _row(cells: list[str], dimension: int) -> list[float]:
    wanted = f"expected {2 * dimension} finite numbers, {dimension} positions and {dimension} momenta"
    try:
        numbers = [float(decimal_of(cell)) for cell in cells]
    except ValueError:
        raise ValueError(f"{wanted}, got {','.join(cells)!r}") from None
    if len(numbers) != 2 * dimension or not np.isfinite(numbers).all():
        raise ValueError(f"{wanted}, got {','.join(cells)!r}")
    return numbers


def _is_header(cells: list[str]) -> bool:
    """Return True if no cell is a number; an invalid first line with a number is an error."""
    for cell in cells:
        try:
            float(cell)
        except ValueError:
            continue
        return False
    return True
