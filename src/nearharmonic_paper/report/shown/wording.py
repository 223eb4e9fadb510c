"""Formats of numbers and verdicts on the page."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from nearharmonic_paper.claims.pages.summary import VERDICTS, in_words

#: Pattern of a Python float; a number with more digits is an exact decimal.
_FLOAT = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
_MOST_DIGITS_OF_A_FLOAT = 17
#: Displayed digits of a float.
_SHOWN = 4


def cell(text: str) -> str:
    """Return the displayed text of a cell of a CSV file: a float with four digits, other cells unchanged."""
    if not _FLOAT.fullmatch(text) or ("." not in text and "e" not in text):
        return text
    digits = re.sub(r"e.*|\D", "", text).lstrip("0")
    return f"{float(text):.{_SHOWN}g}" if _SHOWN < len(digits) <= _MOST_DIGITS_OF_A_FLOAT else text


def is_number(text: str) -> bool:
    """Return True if a cell is a number, nan or an infinity."""
    return bool(_FLOAT.fullmatch(text)) or text in {"nan", "inf", "-inf"}


def percent(share: float) -> str:
    """Return a fraction as a percentage with two digits, or "below 0.01 %"."""
    return f"{100 * share:.2g} %" if share >= 1e-4 or share == 0 else "below 0.01 %"


def tallied(claims: Sequence[Mapping[str, Any]]) -> str:
    """Return the number of statements with each verdict in words: 1 fails, 2 hold."""
    return in_words(Counter(claim["verdict"] for claim in claims))


def verdict(name: str, number: int) -> str:
    """Return a verdict on ``number`` statements: 1 holds, 2 hold."""
    return name if number == 1 else VERDICTS[name].removeprefix("are ")


def counted(number: int, one: str, more: str = "") -> str:
    """Return ``number`` with its noun: 1 claim, 2 claims."""
    return f"{number} {one if number == 1 else more or one + 's'}"
