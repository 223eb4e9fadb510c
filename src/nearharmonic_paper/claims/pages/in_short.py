"""Short forms of measured values for README's table: parts of the values of statements."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

#: Systems by the ends of ids, in the order of the paper.
SYSTEMS = {"sho": "oscillator", "henon-heiles": "Hénon-Heiles", "kepler": "Sun-Mercury"}
_NAMES = "oscillator|Hénon-Heiles system|Sun-Mercury system"

Shorten = Callable[[str], str]


def found(pattern: str, value: str) -> str:
    """Return the first matching group of the first match, or the whole match without groups.

    Raises
    ------
    ValueError
        There is no match: the value has other words than README expects.
    """
    match = re.search(pattern, value)
    if match is None:
        message = f"README's table looks for {pattern!r} in {value!r}"
        raise ValueError(message)
    return next((group for group in match.groups() if group is not None), match[0])


def _each_system(pattern: str, value: str) -> str:
    """Return the name of each system and the text after it."""
    told = re.findall(rf"({_NAMES}) {pattern}", value)
    return ", ".join(f"{name.removesuffix(' system')} {' / '.join(rest)}" for name, *rest in told)


def _decades(value: str) -> str:
    lengths = [float(one) for one in re.findall(r"\(([\d.]+) decades\)", value)]
    return f"{min(lengths):.2f} to {max(lengths):.2f} decades"


def _ahead(value: str) -> str:
    """Return the smallest and the largest number of step sizes at which a new method is better."""
    total = int(found(r"of (\d+):", value))
    counts = [int(one) for one in re.findall(r"B\S+ (\d+)", value)]
    if "each at all" in value or not counts:
        counts.append(total)
    low, high = min(counts), max(counts)
    return f"{low} of {total}" if low == high else f"{low} to {high} of {total}"


def _share(value: str) -> str:
    """Return the step sizes at which a statement about a range is true."""
    every = re.search(r"all (\d+) step sizes", value)
    return f"{every[1]} of {every[1]}" if every else found(r"\d+ of \d+(?= step sizes)", value)


#: id -> short form of its value; other ids show the whole value.
SHORT: Mapping[str, Shorten] = {
    "significantly-better": lambda value: (
        "pairs won by maximum / mean error, of 24: " + _each_system(r"(\d+) and (\d+) of 24", value)
    ),
    "fig-1-sixth-order": lambda value: f"slope 6 over {_decades(value)}",
    "fig-3-sixth-order-descent": lambda value: f"slope 6 over {_decades(value)}; half a decade asked",
    "fig-5-best-mean": lambda value: f"{_share(value)} step sizes: {found(r'^(.*?),', value)}",
}
#: Beginning of ids -> words, and short form of the value for each system.
BY_SYSTEM: Mapping[str, tuple[str, Shorten]] = {
    "outperform-blanes": ("step sizes at which a new method is ahead", _ahead),
    "outperform-ruth": ("step sizes with a factor of 100", _share),
}


def in_short(name: str, value: str) -> str:
    """Return the short form of the value of a statement in README."""
    return SHORT.get(name, str)(value)


def by_system(name: str, values: Sequence[str]) -> str:
    """Return the short forms of statements about each system, in the order of :data:`SYSTEMS`."""
    words, shorten = BY_SYSTEM[name]
    listed = ", ".join(f"{system} {shorten(value)}" for system, value in zip(SYSTEMS.values(), values, strict=True))
    return f"{words}: {listed}"
