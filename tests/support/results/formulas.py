"""Formulas of pages: their LaTeX, evaluated with given values of the symbols."""

from __future__ import annotations

import re
from fractions import Fraction
from math import factorial

from support.results.stated_numbers import ROOT

#: Marks that only shape the text.
_SPACING = re.compile(r"\\(?:left|right|[bB]ig[lr]?)(?![a-zA-Z])|\\[,;! ]|&|\\cdot|\s+")
#: Text between the equations of one formula.
_BETWEEN = re.compile(r"\\\\|(?:\\q?quad\s*)+|\\(?:begin|end){aligned}|(?<=[^\\][,.])\s")
_TOKEN = re.compile(r"\\[a-zA-Z]+|\d|[a-zA-Z]|[-+/^_{}()|!,=]")


def formulas(page):
    """All formulas of a page, displayed and inline, without line breaks."""
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    found = re.findall(r"\$\$(.+?)\$\$|\$(.+?)\$", text, flags=re.DOTALL)
    return [" ".join((displayed or inline).split()) for displayed, inline in found]


def right_sides(page, left):
    """The expressions that formulas of a page equate with ``left``, in the order of the page."""
    rows = (row for formula in formulas(page) for row in _BETWEEN.split(formula))
    equations = (row.replace("&", "").partition("=") for row in rows)
    return [right.strip(" ,.") for name, sign, right in equations if sign and name.strip() == left]


def evaluated(expression, **symbols):
    """The value of an expression; ``symbols`` are numbers by name (``c_1``, ``tau``) or functions of the subscripts."""
    tokens = _TOKEN.findall(_SPACING.sub(" ", expression.strip(" .,")))
    parser = _Parser(tokens)
    found = parser.sum()
    assert not parser.tokens, f"{expression}: not read from {' '.join(parser.tokens[:5])}"
    return found(symbols)


class _Parser:
    """Reads tokens from left to right; each method returns a function of the symbols."""

    def __init__(self, tokens):
        self.tokens, self.open_bars = list(tokens), 0

    def take(self, *wanted):
        if self.tokens and (not wanted or self.tokens[0] in wanted):
            return self.tokens.pop(0)
        return None

    def sum(self):
        terms = [(self.take("-", "+") or "+", self.product())]
        while sign := self.take("-", "+"):
            terms.append((sign, self.product()))

        def total(symbols):
            return sum((-term(symbols) if sign == "-" else term(symbols)) for sign, term in terms)

        return total

    def product(self):
        if self.take(r"\sum"):
            return self.series()
        factors = [("*", self.factor())]
        ends = {"+", "-", ")", "}", ",", "="} | ({"|"} if self.open_bars else set())
        while self.tokens and self.tokens[0] not in ends:
            if self.tokens[0] == r"\sum":
                factors.append(("*", self.product()))
                break
            factors.append(("/" if self.take("/") else "*", self.factor()))

        def value(symbols):
            found = Fraction(1)
            for operation, factor in factors:
                found = found / factor(symbols) if operation == "/" else found * factor(symbols)
            return found

        return value

    def series(self):
        assert self.take("_")
        name, *first = re.fullmatch(r"(\w)=(.+)", "".join(self.group())).groups()
        assert self.take("^")
        low, high, body = (_Parser(_TOKEN.findall(first[0])).sum(), _Parser(self.group()).sum(), self.product())
        return lambda symbols: sum(
            (body({**symbols, name: n}) for n in range(int(low(symbols)), int(high(symbols)) + 1)), Fraction(0)
        )

    def factor(self):
        base = self.atom()
        while mark := self.take("^", "!"):
            base = self._raised(base, _Parser(self.group()).sum()) if mark == "^" else self._factorial(base)
        return base

    @staticmethod
    def _raised(base, power):
        return lambda symbols: base(symbols) ** power(symbols)

    @staticmethod
    def _factorial(base):
        return lambda symbols: factorial(int(base(symbols)))

    def group(self):
        """The tokens of a group in braces, or the next token."""
        if not self.take("{"):
            return [self.take()]
        found, depth = [], 1
        while depth:
            token = self.take()
            depth += {"{": 1, "}": -1}.get(token, 0)
            found.append(token)
        return found[:-1]

    def atom(self):
        token = self.take()
        if token.isdigit():
            while self.tokens and self.tokens[0].isdigit():
                token += self.take()
            return lambda symbols: Fraction(token)
        if token in {"(", "{", "|"}:
            self.open_bars += token == "|"
            inside = self.sum()
            self.open_bars -= token == "|"
            assert self.take({"(": ")", "{": "}", "|": "|"}[token])
            return (lambda symbols: abs(inside(symbols))) if token == "|" else inside
        if token in {r"\frac", r"\tfrac"}:
            top, bottom = (_Parser(self.group()).sum() for _ in range(2))
            return lambda symbols: top(symbols) / bottom(symbols)
        return self.symbol(token.lstrip("\\"))

    def symbol(self, name):
        if not self.take("_"):
            return lambda symbols: symbols[name]
        group = self.group()
        places = [_Parser(_TOKEN.findall(part)).sum() for part in "".join(group).split(",")]

        def value(symbols):
            whole = f"{name}_{''.join(group)}"
            return symbols[whole] if whole in symbols else symbols[name](*(int(place(symbols)) for place in places))

        return value
