"""Conditions on columns, written as Python comparisons: parsed by ``ast`` and evaluated with numpy, node by node.

Allowed are comparisons (chained ones too), ``and``, ``or``, ``not``, parentheses, ``+ - * /``, numbers, texts, names of
columns, ``inf``, and ``in`` with a list of numbers or texts. No other node is evaluated: no call and no attribute.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from functools import reduce
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from nearharmonic.errors import SettingError, unknown_name

NUMBER, TEXT, TRUTH = "a number", "a text", "a condition"

_FUNCTIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.And: np.logical_and, ast.Or: np.logical_or, ast.Not: np.logical_not, ast.UAdd: operator.pos,
    ast.USub: operator.neg, ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip
_ALLOWED = "comparisons, and, or, not, + - * /, numbers, texts in quotes, columns and in [...]"


def rows_where(text: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the mask of the rows that fulfil a condition, such as ``max_energy_error < 1e-9 and status == 'ok'``.

    Columns are arrays of numbers or of texts, of the same length. A comparison with NaN is false.

    Raises
    ------
    SettingError
        The text is no such condition, or compares numbers with texts; the message has the position.
    UnknownNameError
        A name is no column.
    """
    source = " ".join(text.split())
    try:
        with np.errstate(all="ignore"):
            mask = _Condition(source, columns).value(_parsed(source))
    except (RecursionError, MemoryError):  # from the parser, or from the recursion below
        raise SettingError("where is too deeply nested") from None
    if _kind(mask) != TRUTH:
        raise SettingError(f"where = {source!r} is {_kind(mask)}, not a condition; allowed are {_ALLOWED}")
    return np.broadcast_to(mask, next((len(columns[name]) for name in columns), 0))


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


def _kind(value: Any) -> str:
    return {"b": TRUTH, "f": NUMBER, "O": TEXT}[value.dtype.kind]


class _Condition:
    """Evaluator of a parsed condition on columns; every value is a numpy scalar or array of floats, texts or truths."""

    def __init__(self, source: str, columns: Mapping[str, np.ndarray]) -> None:
        self._source = source
        self._columns = columns

    def value(self, node: ast.expr) -> Any:
        """Return the value of a part."""
        match node:
            case ast.BoolOp(op=sign, values=parts):
                return reduce(_FUNCTIONS[type(sign)], [self._of_kind(part, TRUTH) for part in parts])
            case ast.UnaryOp(op=ast.Not() | ast.UAdd() | ast.USub() as sign, operand=part):
                return _FUNCTIONS[type(sign)](self._of_kind(part, TRUTH if isinstance(sign, ast.Not) else NUMBER))
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as sign):
                return _FUNCTIONS[type(sign)](self._of_kind(node.left, NUMBER), self._of_kind(node.right, NUMBER))
            case ast.Compare(ops=signs):
                pairs = zip(signs, pairwise([node.left, *node.comparators]), strict=True)
                return reduce(np.logical_and, [self._compared(left, sign, right) for sign, (left, right) in pairs])
            case ast.Name(id=name):
                if name not in self._columns and name != "inf":
                    raise unknown_name("column", name, self._columns)
                return self._operand(node, self._columns.get(name, inf))
            case ast.Constant(value=str() | int() | float() as value) if not isinstance(value, bool):
                return self._operand(node, value)
        raise self._refused(node, f"allowed are {_ALLOWED}")

    def _operand(self, node: ast.expr, value: Any) -> Any:
        """Return a column or a constant; integers become floats, so that products do not overflow 64 bits."""
        is_text = not isinstance(value, int | float) and np.asarray(value).dtype.kind in "UO"
        try:
            return np.asarray(value, dtype=object) if is_text else np.asarray(value, dtype=float)
        except OverflowError:
            raise self._refused(node, "it is larger than any number of a column") from None

    def _compared(self, left: ast.expr, sign: ast.cmpop, right: ast.expr) -> Any:
        """Return the values of a comparison, which is false if one side is NaN."""
        if isinstance(sign, ast.Is | ast.IsNot):
            raise self._refused(right, f"allowed are {_ALLOWED}")
        others, value = [right], self.value(left)
        if is_member := isinstance(sign, ast.In | ast.NotIn):
            if not isinstance(right, ast.List | ast.Tuple | ast.Set) or not right.elts:
                raise self._refused(right, "in takes a list of numbers or texts, such as ['ruth', 'aba104']")
            others = right.elts
            for member in others:
                if isinstance(member, ast.Name) and member.id in self._columns:
                    raise self._refused(member, "in takes a list of numbers or texts, no columns")
        values = [self._alike(left, value, other) for other in others]
        function = operator.eq if is_member else _FUNCTIONS[type(sign)]
        found = reduce(np.logical_or, [np.asarray(function(value, other), dtype=bool) for other in values])
        known = [np.asarray(one == one) for one in (value, *values)]  # noqa: PLR0124 - NaN differs from itself
        return reduce(np.logical_and, known, ~found if isinstance(sign, ast.NotIn) else found)

    def _alike(self, left: ast.expr, value: Any, right: ast.expr) -> Any:
        """Return the value of ``right``, which must have the kind of the ``value`` of ``left``."""
        other = self.value(right)
        if TRUTH in {_kind(value), _kind(other)}:
            raise self._refused(left if _kind(value) == TRUTH else right, "a condition cannot be compared")
        if _kind(value) != _kind(other):
            raise self._refused(right, f"it is {_kind(other)}, and {self._words(left)} is {_kind(value)}")
        return other

    def _of_kind(self, node: ast.expr, kind: str) -> Any:
        value = self.value(node)
        if _kind(value) != kind:
            raise self._refused(node, f"it is {_kind(value)}, where {kind} is expected")
        return value

    def _words(self, node: ast.expr) -> str:
        return ast.get_source_segment(self._source, node) or ast.unparse(node)

    def _refused(self, node: ast.expr, reason: str) -> SettingError:
        before = self._source.encode()[: node.col_offset].decode()
        message = f"where = {self._source!r}: {self._words(node)!r}, at character {len(before) + 1}, is not allowed: "
        return SettingError(f"{message}{reason}")
