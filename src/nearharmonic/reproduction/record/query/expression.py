"""Conditions on columns, written as Python comparisons, parsed by ``ast`` and evaluated on whole arrays.

Allowed are comparisons (chained ones too), ``and``, ``or``, ``not``, parentheses, ``+ - * /``, numbers, texts, names
of columns, ``inf``, and ``in`` with a list of numbers or texts. Nothing is ever called or executed.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from nearharmonic.errors import SettingError, unknown_name

NUMBER, TEXT, TRUTH = "a number", "a text", "a condition"

_COMPARISONS: dict[type[ast.cmpop], Any] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_ARITHMETIC: dict[type[ast.operator], Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_ALLOWED = "comparisons, and, or, not, + - * /, numbers, texts in quotes, columns and in [...]"


@dataclass(frozen=True)
class _Operand:
    """The values of a part of an expression, and which of NUMBER, TEXT and TRUTH they are."""

    values: Any
    kind: str


def rows_where(text: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return which rows fulfil a condition.

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
        What is no such condition, or compares numbers with texts; the message says where.
    UnknownNameError
        A name that is no column.
    """
    source = " ".join(text.split())
    try:
        found = _Condition(source, columns).evaluated(_parsed(source))
    except (RecursionError, MemoryError):  # the parser's, or ours where it went deeper
        raise SettingError("where is too deeply nested") from None
    if found.kind != TRUTH:
        raise SettingError(f"where = {source!r} is {found.kind}, not a condition; allowed are {_ALLOWED}")
    rows = len(next(iter(columns.values()))) if columns else 0
    return np.broadcast_to(np.asarray(found.values, dtype=bool), (rows,))


def _parsed(source: str) -> ast.expr:
    try:
        with warnings.catch_warnings(action="ignore"):  # of a backslash in a text, of 1and 2
            return ast.parse(source, mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset or len(source) + 1}: {error.msg}"
        if re.match(r"=[^=]", source[(error.offset or 0) - 1 :]):
            place += "; equality is written =="
    except ValueError as error:
        place = f"because of its characters: {error}"
    raise SettingError(f"where = {source!r} cannot be read {place}")


class _Condition:
    """A parsed condition and the columns that it is about."""

    def __init__(self, source: str, columns: Mapping[str, np.ndarray]) -> None:
        self._source = source
        self._columns = columns

    def evaluated(self, node: ast.expr) -> _Operand:
        rules = {
            ast.BoolOp: self._joined,
            ast.UnaryOp: self._signed,
            ast.BinOp: self._computed,
            ast.Compare: self._compared,
            ast.Name: self._named,
            ast.Constant: self._constant,
        }
        rule: Any = rules.get(type(node))
        if rule is None:
            self._refuse(node, f"allowed are {_ALLOWED}")
        with np.errstate(all="ignore"):
            return rule(node)  # type: ignore[no-any-return]

    def _joined(self, node: ast.BoolOp) -> _Operand:
        parts = [self._of_kind(value, TRUTH) for value in node.values]
        join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        found = parts[0]
        for part in parts[1:]:
            found = join(found, part)
        return _Operand(found, TRUTH)

    def _signed(self, node: ast.UnaryOp) -> _Operand:
        if isinstance(node.op, ast.Not):
            return _Operand(np.logical_not(self._of_kind(node.operand, TRUTH)), TRUTH)
        if isinstance(node.op, ast.Invert):
            self._refuse(node, f"allowed are {_ALLOWED}")
        value = self._of_kind(node.operand, NUMBER)
        return _Operand(-value if isinstance(node.op, ast.USub) else value, NUMBER)

    def _computed(self, node: ast.BinOp) -> _Operand:
        if type(node.op) not in _ARITHMETIC:
            self._refuse(node, f"allowed are {_ALLOWED}")
        left, right = self._of_kind(node.left, NUMBER), self._of_kind(node.right, NUMBER)
        return _Operand(_ARITHMETIC[type(node.op)](left, right), NUMBER)

    def _compared(self, node: ast.Compare) -> _Operand:
        found: Any = np.True_
        left = node.left
        for comparison, right in zip(node.ops, node.comparators, strict=True):
            found = found & self._pair(left, comparison, right)
            left = right
        return _Operand(found, TRUTH)

    def _pair(self, left: ast.expr, comparison: ast.cmpop, right: ast.expr) -> Any:
        """Compare ``left`` with ``right`` by ``comparison``; false where either is NaN."""
        if isinstance(comparison, ast.In | ast.NotIn):
            return self._member(left, right, negated=isinstance(comparison, ast.NotIn))
        if type(comparison) not in _COMPARISONS:
            self._refuse(right, f"allowed are {_ALLOWED}")
        one, other = self.evaluated(left), self.evaluated(right)
        self._check_alike(left, one, right, other)
        found = _COMPARISONS[type(comparison)](one.values, other.values)
        if one.kind == NUMBER and isinstance(comparison, ast.NotEq):
            return found & ~np.isnan(one.values) & ~np.isnan(other.values)
        return found

    def _member(self, left: ast.expr, right: ast.expr, *, negated: bool) -> Any:
        if not isinstance(right, ast.List | ast.Tuple | ast.Set) or not right.elts:
            self._refuse(right, "in takes a list of numbers or texts, such as ['ruth', 'aba104']")
        one = self.evaluated(left)
        members = [self.evaluated(member) for member in right.elts]
        found: Any = np.False_
        for node, member in zip(right.elts, members, strict=True):
            if isinstance(node, ast.Name) and node.id in self._columns:
                self._refuse(node, "in takes a list of numbers or texts, no columns")
            self._check_alike(left, one, node, member)
            found = found | (one.values == member.values)
        if not negated:
            return found
        return ~found & ~np.isnan(one.values) if one.kind == NUMBER else ~found

    def _named(self, node: ast.Name) -> _Operand:
        if node.id not in self._columns:
            if node.id == "inf":
                return _Operand(np.float64(np.inf), NUMBER)
            raise unknown_name("column", node.id, self._columns)
        values = self._columns[node.id]
        # Integers as floats: their products and quotients are those of the numbers, not of 64 bits.
        return _Operand(values, TEXT) if values.dtype.kind == "U" else _Operand(values.astype(np.float64), NUMBER)

    def _constant(self, node: ast.Constant) -> _Operand:
        if isinstance(node.value, str):
            return _Operand(node.value, TEXT)
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            self._refuse(node, f"allowed are {_ALLOWED}")
        try:
            return _Operand(np.float64(node.value), NUMBER)
        except OverflowError:
            self._refuse(node, "it is larger than any number of a column")

    def _of_kind(self, node: ast.expr, kind: str) -> Any:
        found = self.evaluated(node)
        if found.kind != kind:
            self._refuse(node, f"it is {found.kind}, where {kind} is expected")
        return found.values

    def _check_alike(self, left: ast.expr, one: _Operand, right: ast.expr, other: _Operand) -> None:
        if TRUTH in {one.kind, other.kind}:
            self._refuse(left if one.kind == TRUTH else right, "a condition cannot be compared")
        if one.kind != other.kind:
            self._refuse(right, f"it is {other.kind}, and {self._words(left)} is {one.kind}")

    def _words(self, node: ast.expr) -> str:
        return ast.get_source_segment(self._source, node) or ast.unparse(node)

    def _refuse(self, node: ast.expr, reason: str) -> NoReturn:
        before = self._source.encode()[: node.col_offset].decode()
        message = f"where = {self._source!r}: {self._words(node)!r}, at character {len(before) + 1}, is not allowed: "
        raise SettingError(f"{message}{reason}")
