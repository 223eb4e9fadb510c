"""Conditions on columns, written as Python comparisons: parsed by ``ast``, checked, and evaluated by pandas.

Allowed are comparisons (chained ones too), ``and``, ``or``, ``not``, parentheses, ``+ - * /``, numbers, texts, names of
columns, ``inf``, and ``in`` with a list of numbers or texts. The text for pandas is generated from these elements only,
so that it contains no call and no attribute.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import inf
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from nearharmonic.errors import SettingError, unknown_name

NUMBER, TEXT, TRUTH = "a number", "a text", "a condition"

_SIGNS: dict[type[ast.AST], str] = {
    ast.And: "&", ast.Or: "|", ast.Not: "~", ast.UAdd: "+", ast.USub: "-",
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/",
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
}  # fmt: skip
_ALLOWED = "comparisons, and, or, not, + - * /, numbers, texts in quotes, columns and in [...]"


def rows_where(text: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the mask of the rows that fulfil a condition.

    Parameters
    ----------
    text : str
        The condition, such as ``max_energy_error < 1e-9 and status == 'ok'``. A comparison with NaN is false.
    columns : mapping
        Arrays of numbers or of texts, of the same length, by name.

    Returns
    -------
    ndarray of bool
        One for each row.

    Raises
    ------
    SettingError
        The text is no such condition, or compares numbers with texts; the message has the position.
    UnknownNameError
        A name is no column.
    """
    source = " ".join(text.split())
    condition = _Condition(source, columns)
    try:
        kind, written = condition.written(_parsed(source))
        if kind != TRUTH:
            raise SettingError(f"where = {source!r} is {kind}, not a condition; allowed are {_ALLOWED}")
        with np.errstate(all="ignore"):
            found = pd.eval(written, engine="python", local_dict=condition.operands)
    except (RecursionError, MemoryError):  # from the parser, or from the recursion below
        raise SettingError("where is too deeply nested") from None
    return np.asarray(found, dtype=bool)


def _parsed(source: str) -> ast.expr:
    try:
        with warnings.catch_warnings(action="ignore"):  # for a backslash in a text, or for 1and 2
            return ast.parse(source, mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset or len(source) + 1}: {error.msg}"
        if re.match(r"=[^=]", source[(error.offset or 0) - 1 :]):
            place += "; equality is written =="
    except ValueError as error:
        place = f"because of its characters: {error}"
    raise SettingError(f"where = {source!r} cannot be read {place}")


class _Condition:
    """Validator of a parsed condition on columns, and generator of its text for pandas."""

    def __init__(self, source: str, columns: Mapping[str, np.ndarray]) -> None:
        self._source = source
        self._columns = columns
        #: Columns and constants, each as long as a column, by their names in the generated text.
        self._rows = range(next((len(columns[name]) for name in columns), 0))
        self.operands: dict[str, Any] = {}

    def written(self, node: ast.expr) -> tuple[str, str]:
        """Return the kind of a part (NUMBER, TEXT or TRUTH) and the text that pandas evaluates."""
        match node:
            case ast.BoolOp():
                text = f" {_SIGNS[type(node.op)]} ".join(self._of_kind(value, TRUTH) for value in node.values)
                kind = TRUTH
            case ast.UnaryOp(op=ast.Not() | ast.UAdd() | ast.USub()):
                kind = TRUTH if isinstance(node.op, ast.Not) else NUMBER
                text = f"{_SIGNS[type(node.op)]}{self._of_kind(node.operand, kind)}"
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
                kind, sign = NUMBER, _SIGNS[type(node.op)]
                text = f"{self._of_kind(node.left, NUMBER)} {sign} {self._of_kind(node.right, NUMBER)}"
            case ast.Compare():
                kind, pairs = TRUTH, zip(node.ops, pairwise([node.left, *node.comparators]), strict=True)
                text = " & ".join(self._compared(left, sign, right) for sign, (left, right) in pairs)
            case _:
                kind, text = self._operand(node)
        return kind, f"({text})"

    def _compared(self, left: ast.expr, sign: ast.cmpop, right: ast.expr) -> str:
        """Write a comparison that is false if one side is NaN."""
        if isinstance(sign, ast.Is | ast.IsNot):
            self._refuse(right, f"allowed are {_ALLOWED}")
        kind, one = self.written(left)
        if isinstance(sign, ast.In | ast.NotIn):
            found = " | ".join(f"({one} == {member})" for member in self._members(left, kind, right))
            negated = f"~({found})" + (f" & ({one} == {one})" if kind == NUMBER else "")
            return f"({found})" if isinstance(sign, ast.In) else f"({negated})"
        other = self._alike(left, kind, right)
        if kind == NUMBER and isinstance(sign, ast.NotEq):
            return f"(({one} < {other}) | ({one} > {other}))"
        return f"({one} {_SIGNS[type(sign)]} {other})"

    def _members(self, left: ast.expr, kind: str, right: ast.expr) -> Iterator[str]:
        if not isinstance(right, ast.List | ast.Tuple | ast.Set) or not right.elts:
            self._refuse(right, "in takes a list of numbers or texts, such as ['ruth', 'aba104']")
        for member in right.elts:
            if isinstance(member, ast.Name) and member.id in self._columns:
                self._refuse(member, "in takes a list of numbers or texts, no columns")
            yield self._alike(left, kind, member)

    def _alike(self, left: ast.expr, kind: str, right: ast.expr) -> str:
        """Write ``right``, which must have the kind of ``left``."""
        its_kind, written = self.written(right)
        if TRUTH in {kind, its_kind}:
            self._refuse(left if kind == TRUTH else right, "a condition cannot be compared")
        if kind != its_kind:
            self._refuse(right, f"it is {its_kind}, and {self._words(left)} is {kind}")
        return written

    def _operand(self, node: ast.expr) -> tuple[str, str]:
        """Store a column or a constant as a series of numbers or texts, and return its kind and name."""
        match node:
            case ast.Name(id=name):
                if name not in self._columns and name != "inf":
                    raise unknown_name("column", name, self._columns)
                value = self._columns.get(name, inf)
            case ast.Constant(value=str() | int() | float() as value) if not isinstance(value, bool):
                pass
            case _:
                self._refuse(node, f"allowed are {_ALLOWED}")
        is_text = not isinstance(value, int | float) and np.asarray(value).dtype.kind in "UO"
        kind = TEXT if is_text else NUMBER
        try:
            # Integers become floats, so that products do not overflow 64 bits.
            series = pd.Series(np.asarray(value)[()], self._rows, dtype=object if kind == TEXT else float)
        except OverflowError:
            self._refuse(node, "it is larger than any number of a column")
        text = f"operand_{len(self.operands)}"
        self.operands[text] = series
        return kind, text

    def _of_kind(self, node: ast.expr, kind: str) -> str:
        found, written = self.written(node)
        if found != kind:
            self._refuse(node, f"it is {found}, where {kind} is expected")
        return written

    def _words(self, node: ast.expr) -> str:
        return ast.get_source_segment(self._source, node) or ast.unparse(node)

    def _refuse(self, node: ast.expr, reason: str) -> NoReturn:
        before = self._source.encode()[: node.col_offset].decode()
        message = f"where = {self._source!r}: {self._words(node)!r}, at character {len(before) + 1}, is not allowed: "
        raise SettingError(f"{message}{reason}")
