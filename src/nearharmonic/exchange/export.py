"""An integrator as text for another program: data, or a program that takes steps, with Hénon-Heiles as its example.

The folder ``templates`` has the text of each program. A writer fills in coefficients, in the form that its language
has for numbers, and remarks.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from decimal import Decimal
from pathlib import Path
from string import Template
from typing import Any

from nearharmonic.exchange.method import DISTINGUISHING_DIGITS as DOUBLE_DIGITS
from nearharmonic.exchange.method import (
    Coefficients,
    as_registered,
    elements,
    head,
    identifier,
    names,
    nearest_doubles,
    remarks_of_python,
    rounded,
)
from nearharmonic.integrators.tableau import Row, Tableau

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
    "ARKODE evaluates the force once a stage, {count} times a step; SUNDIALS 7.9 leaves out that of a kick of 0."
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


def document(coefficients: Coefficients) -> dict[str, Any]:
    """Return the keys and values of a file of data; None marks a property that the integrator does not have."""
    tableau = coefficients.tableau
    shared = ("name", "label", "source", "order", "harmonic_order", "requires", "symmetric", "first")
    rows = {"digits": coefficients.digits, "kick": list(coefficients.kick), "drift": list(coefficients.drift)}
    return {name: getattr(tableau, name) for name in shared} | rows


def _json(coefficients: Coefficients) -> str:
    """Return the coefficients as JSON; a missing property is null."""
    return json.dumps(document(coefficients), indent=2, ensure_ascii=False) + "\n"


def _toml(coefficients: Coefficients) -> str:
    """Return the coefficients as TOML, without the keys of missing properties, because TOML has no null."""
    import tomli_w

    return tomli_w.dumps({key: value for key, value in document(coefficients).items() if value is not None})


def _c(coefficients: Coefficients) -> str:
    """Return a program in C, in quadruple precision if the coefficients have more digits than a double."""
    quadruple = coefficients.digits > DOUBLE_DIGITS
    suffix = "f128" if quadruple else ""
    feature = "#define __STDC_WANT_IEC_60559_TYPES_EXT__ // for strfromf128\n"
    return _filled(
        "program.c",
        names(coefficients, f"{{}}{suffix}"),
        head=head(coefficients, "//", *([QUADRUPLE.format("_Float128 of GCC and glibc")] if quadruple else [])),
        includes=f"{feature}#include <stdio.h>\n#include <stdlib.h>" if quadruple else "#include <stdio.h>",
        real="_Float128" if quadruple else "double",
        suffix=suffix,
        show=SHOW_QUADRUPLE if quadruple else SHOW_DOUBLE,
    )


def _julia(coefficients: Coefficients) -> str:
    """Return a program in Julia, with numbers of type BigFloat if the coefficients have more digits than a double."""
    big = coefficients.digits > DOUBLE_DIGITS
    number = 'big"{}"' if big else "{}"
    examples = {name: number.format(value) for name, value in (("zero", "0.0"), ("three", "0.3"), ("four", "0.4"))}
    above = head(coefficients, "#", *([BIG] if big else []))
    return _filled("program.jl", names(coefficients, number), examples, head=above)


def _fortran(coefficients: Coefficients) -> str:
    """Return a program in Fortran, in quadruple precision if the coefficients have more digits than a double."""
    quadruple = coefficients.digits > DOUBLE_DIGITS
    return _filled(
        "program.f90",
        names(coefficients, "{}_real_kind", ", &"),
        head=head(coefficients, "!", *([QUADRUPLE.format("real128")] if quadruple else [])),
        kind="real128" if quadruple else "real64",
        width="45.35e4" if quadruple else "25.16e3",
    )


def _diffrax(coefficients: Coefficients) -> str:
    """Return a solver of diffrax, with a pair of terms as its ``SemiImplicitEuler``, named after the integrator."""
    called = names(coefficients)
    above = head(coefficients, "#", DIFFRAX[0], *remarks_of_python(coefficients, *DIFFRAX[1:]))
    given = {"Name": called["name"].capitalize(), "order": coefficients.tableau.order}
    return _filled("diffrax.py.txt", called, given, head=above)


def _rebound(coefficients: Coefficients) -> str:
    """Return a module that registers the integrator with REBOUND, as its example custom_integrator does in C.

    A particle of REBOUND begins with nine doubles: position, velocity and acceleration. numpy therefore drifts and
    kicks all particles at once in the memory of the simulation.
    """
    above = head(coefficients, "#", REBOUND[0], *remarks_of_python(coefficients, *REBOUND[1:]))
    return _filled("rebound.py.txt", names(coefficients), head=above)


def arkode_stages(coefficients: Coefficients) -> tuple[Row, Row]:
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


def _sundials(coefficients: Coefficients) -> str:
    """Return a program in C that passes the table of :func:`arkode_stages` to ARKODE's module SPRKStep."""
    tableau = coefficients.tableau
    kicks, drifts = arkode_stages(coefficients)
    zero = "last drift" if tableau.first == "kick" else "first kick"
    remarks = [SUNDIALS.format(zero=zero, count=len(kicks))] if len(kicks) > tableau.stages else []
    rows = {"ahat": elements(kicks, "    SUN_RCONST({})"), "a": elements(drifts, "    SUN_RCONST({})")}
    told = {"name": identifier(tableau), "stages": len(kicks), "order": tableau.order}
    return _filled("sundials.c", rows, told, head=head(coefficients, "//", *remarks, AUTONOMOUS))


#: Functions that write the text, by target.
WRITERS: Mapping[str, Callable[[Coefficients], str]] = {
    "json": _json, "toml": _toml, "c": _c, "julia": _julia, "rebound": _rebound, "diffrax": _diffrax,
    "sundials": _sundials, "fortran": _fortran,
}  # fmt: skip
#: Targets that are data, not programs.
DATA = ("json", "toml")


def export(tableau: Tableau, to: str, digits: int | None = None) -> str:
    """Return an integrator as text for another program.

    Parameters
    ----------
    to : str
        One of :data:`nearharmonic.exchange.TARGETS`.
    digits : int, optional
        Significant digits of the coefficients. By default data have the digits of the tableau, and programs those of
        the nearest doubles.
    """
    if digits is not None:
        coefficients = rounded(tableau, digits)
    else:
        coefficients = as_registered(tableau) if to in DATA else nearest_doubles(tableau)
    return WRITERS[to](coefficients)
