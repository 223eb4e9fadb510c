"""Description of an integrator at the head of an exported program, and its names in the program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from textwrap import wrap

from nearharmonic import __version__
from nearharmonic.exchange.coefficients import DOUBLE_DIGITS, Coefficients
from nearharmonic.integrators.tableau import Row, Tableau

#: Columns of a comment.
WIDTH = 96
#: Maximum length of an identifier in all languages: Fortran allows 63 characters, and some names get a suffix.
LONGEST_IDENTIFIER = 40


def head(coefficients: Coefficients, mark: str, *remarks: str) -> str:
    """Return the comment at the head of a program: the integrator, its first operator, its source, and ``remarks``.

    ``mark`` begins a comment line in the language. Each remark about the target is a paragraph.
    """
    return comment([*_description(coefficients), *remarks], mark)


def _description(coefficients: Coefficients) -> Iterator[str]:
    tableau = coefficients.tableau
    yield f"{tableau.label}: symplectic integrator for H(q, p) = T(p) + V(q), written by nearharmonic {__version__}."
    yield f"Name: {tableau.name}. {_orders(tableau)}"
    sequence = _sequence(*coefficients.operators, tableau.stages)
    yield (
        f"First: {tableau.first}. A step of length tau is {sequence}. A kick with coefficient c is p -= c tau dV/dq, a "
        "drift with coefficient c is q += c tau dT/dp."
    )
    if tableau.requires is not None:
        yield (
            f"Requires: a {tableau.requires}, T = p.p/2 or p.A p/2 with a constant matrix A. For any other T, or "
            f"if the two rows exchange their roles, only order {1 + tableau.symmetric} is certain."
        )
    elif tableau.harmonic_order is not None:
        yield "The harmonic order is lost if the two rows exchange their roles."
    if not tableau.symmetric:
        yield "Not symmetric: a step of -tau does not undo a step of tau."
    yield f"Coefficients: {coefficients.rounding}."
    yield f"Source: {tableau.source}"


def _orders(tableau: Tableau) -> str:
    harmonic = "" if tableau.harmonic_order is None else f" Harmonic order: {tableau.harmonic_order}."
    return f"Order: {tableau.order}.{harmonic} Stages (force evaluations per step): {tableau.stages}."


def _sequence(outer: str, inner: str, stages: int) -> str:
    """Return the substeps of a step in order, such as kick[0], drift[0], kick[1]."""
    if stages == 1:
        return f"{outer}[0], {inner}[0], {outer}[1]"
    between = ", ..., " if stages > 2 else ", "
    return f"{outer}[0], {inner}[0], {outer}[1]{between}{inner}[{stages - 1}], {outer}[{stages}]"


def comment(paragraphs: list[str], mark: str) -> str:
    """Return ``paragraphs`` as comment lines that begin with ``mark``.

    Line ends in a user's label or source become spaces. A backslash at the end of a line would continue the comment.
    """
    lines = []
    for paragraph in paragraphs:
        lines += wrap(paragraph, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"{mark} {line}." if line.endswith("\\") else f"{mark} {line}" for line in lines)


def identifier(tableau: Tableau) -> str:
    """Return the name of ``tableau`` as an identifier of C, Fortran, Julia and Python."""
    name = re.sub(r"\W+", "_", tableau.name, flags=re.ASCII).strip("_").lower()[:LONGEST_IDENTIFIER]
    return name if name[:1].isalpha() else f"method_{name}".rstrip("_")


def elements(row: Row, form: str = "{}", separator: str = ",") -> str:
    """Return the numbers of ``row``, one per line.

    ``form`` is the format of a number in the language. ``separator`` ends each line; the last line has it only if it is
    a comma.
    """
    lines = [f"    {form.format(text)}" for text in row]
    return f"{separator}\n".join(lines) + ("," if separator == "," else "")


def names(coefficients: Coefficients, form: str = "{}", separator: str = ",") -> dict[str, str]:
    """Return the names of the integrator and its operators, and its rows as :func:`elements`, for a template."""
    outer, inner = coefficients.operators
    rows = {row: elements(getattr(coefficients, row), form, separator) for row in ("kick", "drift")}
    return {
        "name": identifier(coefficients.tableau),
        "stages": str(coefficients.stages),
        **rows,
        "outer": outer,
        "OUTER": outer.upper(),
        "outer_rows": rows[outer],
        "inner": inner,
        "INNER": inner.upper(),
        "inner_rows": rows[inner],
    }


def remarks_of_python(coefficients: Coefficients, own_force: str, doubles: str) -> list[str]:
    """Return the remarks that apply to the integrator in a Python library.

    ``own_force`` is the reason for ``{count}`` force evaluations per step of a method with kicks at both ends.
    ``doubles`` is the treatment of more digits than doubles have.
    """
    remarks = []
    if coefficients.first_same_as_last:
        remarks.append(own_force.format(count=coefficients.stages + 1))
    if coefficients.digits > DOUBLE_DIGITS:
        remarks.append(doubles)
    return remarks
