"""Files of coefficients, read without rounding, and integrators as text for other programs.

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
from string import Template
from typing import Any, NoReturn, cast

from nearharmonic.errors import TableauError, shown
from nearharmonic.exchange import method
from nearharmonic.integrators.tableau import DECIMAL, QUADRATIC_KINETIC_ENERGY, First, Row, Tableau
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
    from nearharmonic.integrators import integrators, tableau_at

    tableau = method.as_registered(tableau_at(place, integrators.registered))
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
            f"{path}: {lengths} cannot alternate with the {claimed} first, which needs as many or one more"
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


# --- An integrator as text for another program: data, or a program that takes steps, with Hénon-Heiles as its example.
#
# The folder ``templates`` has the text of each program. A writer fills in coefficients, in the form that its language
# has for numbers, and remarks.

TEMPLATES = Path(__file__).parent / "templates"

QUADRUPLE = "More than 17 digits are for quadruple precision, {}, which holds 36 of them at most."
BIG = "More than 17 digits are for BigFloat, which holds 77 of them unless setprecision says otherwise."
DIFFRAX = (
    "diffrax: the terms are a pair (velocity, force), the state is a pair (q, p): velocity(t, p, args) is dT/dp and "
    "force(t, q, args) is -dV/dq. The step size is constant; values between steps are interpolated linearly.",
    "A step evaluates the force {count} times: the force at its end is not kept for the next step.",
    "JAX computes in double precision at most: digits beyond 17 have no effect.",
)
REBOUND = (
    "REBOUND: q are positions and p velocities, T is quadratic, and a kick is v += c dt a with REBOUND's forces.",
    "A step evaluates the forces {count} times: REBOUND may change particles between two steps, so that the forces at "
    "the end of a step are not reused.",
    "REBOUND computes in double precision: digits beyond 17 have no effect.",
)
SUNDIALS = (
    "SUNDIALS: stage i of ARKODE is a kick with ahat[i], then a drift with a[i]; the added {zero} is 0. "
    "ARKODE evaluates the force once a stage, {count} times a step; SUNDIALS 7.9 skips it for a kick of 0."
)
AUTONOMOUS = (
    "V must not depend on time: ARKODE evaluates the force at t + tau (ahat[0] + ... + ahat[i]), where this method "
    "needs t + tau (a[0] + ... + a[i-1]). For such a V let t be one more coordinate, with dt/dt = 1."
)

#: Functions in C that print two numbers: doubles, and numbers of quadruple precision.
SHOW_DOUBLE = """\
static void show(const char *label, const real *x)
{
    printf("%s = %.17g %.17g\\n", label, x[0], x[1]);
}"""
SHOW_QUADRUPLE = """\
static void show(const char *label, const real *x)
{
    char first[64], second[64];
    strfromf128(first, sizeof first, "%.36g", x[0]);
    strfromf128(second, sizeof second, "%.36g", x[1]);
    printf("%s = %s %s\\n", label, first, second);
}"""


def _filled(template: str, *values: Mapping[str, Any], **more: Any) -> str:
    """Return the text of a file of :data:`TEMPLATES` with its names replaced."""
    given = {name: value for mapping in values for name, value in mapping.items()}
    return Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(given | more)


def document(coefficients: method.Coefficients) -> dict[str, Any]:
    """Return the keys and values of a file of data; None marks a property that the integrator does not have."""
    tableau = coefficients.tableau
    shared = ("name", "label", "source", "order", "harmonic_order", "requires", "symmetric", "first")
    rows = {"digits": coefficients.digits, "kick": list(coefficients.kick), "drift": list(coefficients.drift)}
    return {name: getattr(tableau, name) for name in shared} | rows


def _json(coefficients: method.Coefficients) -> str:
    """Return the coefficients as JSON; a missing property is null."""
    return json.dumps(document(coefficients), indent=2, ensure_ascii=False) + "\n"


def _toml(coefficients: method.Coefficients) -> str:
    """Return the coefficients as TOML, without the keys of missing properties, because TOML has no null."""
    import tomli_w

    return tomli_w.dumps({key: value for key, value in document(coefficients).items() if value is not None})


def _c(coefficients: method.Coefficients) -> str:
    """Return a program in C, in quadruple precision if the coefficients have more digits than a double."""
    quadruple = coefficients.digits > method.DISTINGUISHING_DIGITS
    suffix = "f128" if quadruple else ""
    feature = "#define __STDC_WANT_IEC_60559_TYPES_EXT__ // for strfromf128\n"
    return _filled(
        "program.c",
        method.names(coefficients, f"{{}}{suffix}"),
        head=method.head(coefficients, "//", *([QUADRUPLE.format("_Float128 of GCC and glibc")] if quadruple else [])),
        includes=f"{feature}#include <stdio.h>\n#include <stdlib.h>" if quadruple else "#include <stdio.h>",
        real="_Float128" if quadruple else "double",
        suffix=suffix,
        show=SHOW_QUADRUPLE if quadruple else SHOW_DOUBLE,
    )


def _julia(coefficients: method.Coefficients) -> str:
    """Return a program in Julia, with numbers of type BigFloat if the coefficients have more digits than a double."""
    big = coefficients.digits > method.DISTINGUISHING_DIGITS
    number = 'big"{}"' if big else "{}"
    examples = {name: number.format(value) for name, value in (("zero", "0.0"), ("three", "0.3"), ("four", "0.4"))}
    above = method.head(coefficients, "#", *([BIG] if big else []))
    return _filled("program.jl", method.names(coefficients, number), examples, head=above)


def _fortran(coefficients: method.Coefficients) -> str:
    """Return a program in Fortran, in quadruple precision if the coefficients have more digits than a double."""
    quadruple = coefficients.digits > method.DISTINGUISHING_DIGITS
    return _filled(
        "program.f90",
        method.names(coefficients, "{}_real_kind", ", &"),
        head=method.head(coefficients, "!", *([QUADRUPLE.format("real128")] if quadruple else [])),
        kind="real128" if quadruple else "real64",
        width="45.35e4" if quadruple else "25.16e3",
    )


def _diffrax(coefficients: method.Coefficients) -> str:
    """Return a solver of diffrax, with a pair of terms as its ``SemiImplicitEuler``, named after the integrator."""
    called = method.names(coefficients)
    above = method.head(coefficients, "#", DIFFRAX[0], *method.remarks_of_python(coefficients, *DIFFRAX[1:]))
    given = {"Name": called["name"].capitalize(), "order": coefficients.tableau.order}
    return _filled("diffrax.py.txt", called, given, head=above)


def _rebound(coefficients: method.Coefficients) -> str:
    """Return a module that registers the integrator with REBOUND, as its example custom_integrator does in C.

    A particle of REBOUND begins with nine doubles: position, velocity and acceleration. numpy therefore drifts and
    kicks all particles at once in the memory of the simulation.
    """
    above = method.head(coefficients, "#", REBOUND[0], *method.remarks_of_python(coefficients, *REBOUND[1:]))
    return _filled("rebound.py.txt", method.names(coefficients), head=above)


def arkode_stages(coefficients: method.Coefficients) -> tuple[Row, Row]:
    """Return the kicks ``ahat`` and the drifts ``a`` of ARKODE's stages, s + 1 for the s stages of the integrator.

    In a stage i ARKODE kicks with ahat[i] and then drifts with a[i] (sprkStep_TakeStep of SUNDIALS 7.5; order of the
    arguments as in ARKodeSPRKTable_Create). A step that begins with a drift therefore gets a first kick of zero, and a
    step that ends in a kick a last drift of zero, as ARKODE's own leapfrogs and Yoshida's method do. A stage with two
    zeros is omitted: the first or last stage of a method with as many kicks as drifts.
    """
    kick_first = coefficients.first == "kick"
    kicks = coefficients.kick if kick_first else ("0.0", *coefficients.kick)
    drifts = (*coefficients.drift, "0.0") if kick_first else coefficients.drift
    pairs = [pair for pair in zip(kicks, drifts, strict=True) if any(map(Decimal, pair))]
    ahat, a = zip(*pairs, strict=True)
    return ahat, a


def _sundials(coefficients: method.Coefficients) -> str:
    """Return a program in C that passes the table of :func:`arkode_stages` to ARKODE's module SPRKStep."""
    tableau = coefficients.tableau
    kicks, drifts = arkode_stages(coefficients)
    zero = "last drift" if tableau.first == "kick" else "first kick"
    remarks = [SUNDIALS.format(zero=zero, count=len(kicks))] if len(kicks) > tableau.stages else []
    rows = {"ahat": method.elements(kicks, "    SUN_RCONST({})"), "a": method.elements(drifts, "    SUN_RCONST({})")}
    told = {"name": method.identifier(tableau), "stages": len(kicks), "order": tableau.order}
    return _filled("sundials.c", rows, told, head=method.head(coefficients, "//", *remarks, AUTONOMOUS))


#: Functions that write the text, by target.
WRITERS: Mapping[str, Callable[[method.Coefficients], str]] = {
    "json": _json, "toml": _toml, "c": _c, "julia": _julia, "rebound": _rebound, "diffrax": _diffrax,
    "sundials": _sundials, "fortran": _fortran,
}  # fmt: skip
#: Targets that are data, not programs.
DATA_TARGETS = ("json", "toml")


def export(tableau: Tableau, to: str, digits: int | None = None) -> str:
    """Return an integrator as text for another program.

    Parameters
    ----------
    to : str
        One of :data:`nearharmonic.exchange.TARGETS`.
    digits : int, optional
        Significant digits of the coefficients. By default data have the digits of the tableau, and programs the
        digits of the nearest doubles.
    """
    if digits is not None:
        coefficients = method.rounded(tableau, digits)
    else:
        coefficients = method.as_registered(tableau) if to in DATA_TARGETS else method.nearest_doubles(tableau)
    return WRITERS[to](coefficients)
