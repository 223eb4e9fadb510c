"""Texts of this repository, and the numbers that they state."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def flat(page):
    """The text of a page, in which line breaks count as spaces."""
    return re.sub(r"\s+", " ", (ROOT / page).read_text(encoding="utf-8"))


def plain(text):
    """Powers of ten as a program reads them: 2 × 10⁻³ becomes 2e-3, and 10⁻³ becomes 1e-3."""
    written = re.sub(r" × 10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)", lambda found: "e" + found[1].translate(DIGITS), text)
    return re.sub(r"\b10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)", lambda found: "1e" + found[1].translate(DIGITS), written)


def numbers(text, pattern):
    """The numbers that ``pattern`` finds in ``text``, where it occurs once."""
    (found,) = re.findall(pattern, text)
    return [float(plain(word)) for word in ([found] if isinstance(found, str) else found)]


def states(page, wanted, *words):
    """Return True if the one sentence or item with all these words has the wanted numbers one after another."""
    (sentence,) = [one for one in re.split(r"(?<=[.:])\s|\s-\s", flat(page)) if all(word in one for word in words)]
    return shows(sentence, wanted)


def shows(text, wanted):
    """Return True if a text has the wanted numbers one after another."""
    found = [float(one) for one in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?(?![\w])", plain(text))]
    return any(found[i : i + len(wanted)] == list(wanted) for i in range(len(found)))
