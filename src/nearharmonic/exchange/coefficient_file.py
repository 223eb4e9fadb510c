"""Files of coefficients from any source: JSON, TOML, CSV or a user's Python file, read without rounding.

The rows hold the coefficients in the order in which they are applied. The row of the operator that is applied first has
as many coefficients as the other row, or one more. All other keys are claims of the file. Claims are never used without
proof.
"""

from __future__ import annotations

import csv
import json
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, cast

from nearharmonic.errors import TableauError, shown
from nearharmonic.integrators.composition import DECIMAL
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, First, Row
from nearharmonic.registry import split_path

#: Highest orders for which conditions are examined; the number of words doubles with each order.
HIGHEST_ORDER = 10
#: Harmonic orders that a file may claim.
HIGHEST_HARMONIC_ORDER = 100
#: Limits: coefficients per row, characters per coefficient, and absolute value of a coefficient.
LONGEST_ROW, LONGEST_NUMBER, LARGEST_NUMBER = 100, 400, 1000
#: Most bytes of a file.
MOST_BYTES = 10**6

_ROWS = ("kick", "drift")
_TEXTS = ("name", "label", "source", "note")
_KEYS = (*_TEXTS, "order", "harmonic_order", "requires", "symmetric", "first", "digits", *_ROWS)


@dataclass(frozen=True, kw_only=True)
class CoefficientFile:
    """The coefficients of one step in a file, and the claims of the file about them, None if there are none.

    The default of ``name`` is the file name, and the default of ``label`` is ``name``. Rows are decimal numbers in the
    order in which they are applied. ``requires`` is
    :data:`~nearharmonic.integrators.tableau.QUADRATIC_KINETIC_ENERGY` if the order is claimed for T = p.p/2 alone,
    ``symmetric`` the claim that the step is (True) or is not (False) a palindrome, and ``digits`` that on the
    significant digits to which the coefficients are rounded.
    """

    path: str
    name: str
    label: str
    source: str
    kick: Row
    drift: Row
    first: First
    order: int | None = None
    harmonic_order: int | None = None
    requires: str | None = None
    symmetric: bool | None = None
    digits: int | None = None


def read(path: str) -> CoefficientFile:
    """Return the coefficients of a file.

    Parameters
    ----------
    path : str
        A file that ends with .json, .toml, .csv or .py. A CSV file has either a header ``kick,drift`` and one
        coefficient of each per line (the shorter column ends with an empty cell), or lines such as ``kick,0.5,0.5`` and
        ``drift,1`` and a line ``key,value`` for each claim; ``#`` begins a comment. A Python file defines an
        integrator; if it defines several, the path ends with ``:`` and a name.

    Returns
    -------
    CoefficientFile
        The rows and the claims.
    """
    readers: Mapping[str, Callable[[str], Any]] = {
        ".json": partial(json.loads, parse_float=Decimal, object_pairs_hook=_once),
        ".toml": partial(tomllib.loads, parse_float=Decimal),
        ".csv": _csv,
    }
    place = Path(path)
    if split_path(path)[0].endswith(".py"):
        return _checked(path, _python(path))
    if place.suffix.lower() not in readers:
        raise TableauError(f"{path}: a file of coefficients ends with {', '.join(readers)}, .py")
    if not place.is_file():
        raise TableauError(f"{path}: there is no such file")
    if place.stat().st_size > MOST_BYTES:
        raise TableauError(f"{path} cannot be read as {place.suffix[1:].upper()}: it has more than {MOST_BYTES} bytes")
    try:
        found = readers[place.suffix.lower()](place.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError, csv.Error) as error:
        reason = next(iter(str(error).splitlines()), "it is nested too deeply")
        raise TableauError(f"{path} cannot be read as {place.suffix[1:].upper()}: {reason}") from None
    if not isinstance(found, dict):
        raise TableauError(f"{path} holds no keys and values: expected at least kick and drift")
    return _checked(path, {key: value for key, value in found.items() if value is not None})


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the members of a JSON object, of which Python's reader would take the last one of a name."""
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"there are two keys {shown(key)}")
        found[key] = value
    return found


def _csv(text: str) -> dict[str, Any]:
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines)]
    if rows and sorted(rows[0]) == sorted(_ROWS):
        columns = {key: [row[i] for row in rows[1:] if i < len(row)] for i, key in enumerate(rows[0])}
        return {key: _without_empty_end(column) for key, column in columns.items()}
    found: dict[str, Any] = {}
    for key, *cells in rows:
        if key in found:
            raise ValueError(f"there are two lines {key!r}")
        found[key] = _without_empty_end(cells) if key in _ROWS else _typed(",".join(cells))
    return found


def _python(place: str) -> dict[str, Any]:
    """Return the tableau of a user's file as a document."""
    from nearharmonic.exchange.export import document
    from nearharmonic.exchange.method import as_registered
    from nearharmonic.integrators import integrators
    from nearharmonic.integrators.file import tableau_at

    tableau = as_registered(tableau_at(place, integrators.registered))
    return {key: value for key, value in document(tableau).items() if value is not None}


def _without_empty_end(cells: list[str]) -> list[str]:
    while cells and not cells[-1]:
        cells = cells[:-1]
    return cells


def _typed(cell: str) -> object:
    """Convert the cell of a claim to an integer, a bool, or text."""
    truth = {"true": True, "false": False, "": None}
    if cell.lower() in truth:
        return truth[cell.lower()]
    return int(cell) if re.fullmatch(r"[+-]?\d{1,9}", cell, re.ASCII) else cell


def _checked(path: str, found: dict[str, Any]) -> CoefficientFile:
    for key in found:
        if key not in _KEYS:
            nearest = get_close_matches(key, _KEYS, n=1)
            hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
            raise TableauError(f"{path}: unknown key {key!r}.{hint} Known: {', '.join(_KEYS)}")
    for key in _TEXTS:
        if not isinstance(found.get(key, ""), str):
            _refuse(path, key, found[key], "a text")
    name = found.get("name") or Path(path).stem
    kick, drift = _row(path, found, "kick"), _row(path, found, "drift")
    return CoefficientFile(
        path=path,
        name=name,
        label=found.get("label") or name,
        source=found.get("source", ""),
        kick=kick,
        drift=drift,
        first=_first(path, found.get("first"), len(kick), len(drift)),
        order=_integer(path, found, "order", HIGHEST_ORDER),
        harmonic_order=_integer(path, found, "harmonic_order", HIGHEST_HARMONIC_ORDER),
        requires=_requirement(path, found.get("requires")),
        symmetric=_truth(path, found.get("symmetric")),
        digits=_integer(path, found, "digits", LONGEST_NUMBER),
    )


def _row(path: str, found: Mapping[str, Any], key: str) -> Row:
    row = found.get(key)
    if row is None:
        raise TableauError(f"{path}: the key {key!r} is missing, the list of the {key} coefficients")
    if not isinstance(row, list) or not 1 <= len(row) <= LONGEST_ROW:
        _refuse(path, key, row, f"a list of 1 to {LONGEST_ROW} decimal numbers")
    texts = []
    for i, value in enumerate(row):
        number = isinstance(value, str | int | Decimal) and not isinstance(value, bool)
        text = str(value).strip() if number else ""
        decimal = len(text) <= LONGEST_NUMBER and DECIMAL.fullmatch(text) is not None
        if not decimal or abs(Decimal(text)) > LARGEST_NUMBER:
            allowed = (
                f"a decimal number of at most {LONGEST_NUMBER} characters, from -{LARGEST_NUMBER} to {LARGEST_NUMBER}"
            )
            _refuse(path, f"{key}[{i}]", value, allowed)
        texts.append(text)
    if not any(map(Decimal, texts)):
        raise TableauError(f"{path}: every {key} coefficient is 0")
    return tuple(texts)


def _first(path: str, claimed: Any, kicks: int, drifts: int) -> First:
    if claimed not in (None, *_ROWS):
        _refuse(path, "first", claimed, "'kick' or 'drift'")
    lengths = f"{kicks} kick{'s' * (kicks > 1)} and {drifts} drift{'s' * (drifts > 1)}"
    if claimed is None:
        if kicks == drifts:
            raise TableauError(f"{path}: with {lengths}, the key 'first' has to say which one is applied first")
        claimed = "kick" if kicks > drifts else "drift"
    ahead = (kicks - drifts) * (1 if claimed == "kick" else -1)
    if ahead not in (0, 1):
        raise TableauError(
            f"{path}: {lengths} cannot take turns with the {claimed} first, which has as many or one more"
        )
    return cast("First", claimed)


def _integer(path: str, found: Mapping[str, Any], key: str, highest: int) -> int | None:
    value = found.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= highest:
        _refuse(path, key, value, f"an integer from 1 to {highest}")
    return int(value)


def _requirement(path: str, value: Any) -> str | None:
    if value in (None, ""):
        return None
    if not isinstance(value, str) or value.replace("_", " ") != QUADRATIC_KINETIC_ENERGY:
        _refuse(path, "requires", value, f"{QUADRATIC_KINETIC_ENERGY!r}, or no such key")
    return QUADRATIC_KINETIC_ENERGY


def _truth(path: str, value: Any) -> bool | None:
    if value is not None and not isinstance(value, bool):
        _refuse(path, "symmetric", value, "true or false")
    return value


def _refuse(path: str, key: str, value: object, allowed: str) -> NoReturn:
    given = shown(str(value) if isinstance(value, Decimal) else value)
    raise TableauError(f"{path}: {key} = {given} is not allowed: {allowed}")
