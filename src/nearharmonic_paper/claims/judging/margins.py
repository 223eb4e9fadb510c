"""Margins: the range of thresholds of a statement that leave its verdict unchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from nearharmonic_paper.claims.results import Undecided, short

#: The margin of proofs, counts and comparisons of digits.
EXACT = "exact: no threshold"
#: Successive factors of a threshold: in steps of 12 % up to ten, then by squares.
_STEP, _CLOSE, _FARTHEST = 10 ** (1 / 20), 20, 1e150


def margin(verdict_at: Callable[[float], str], bound: float) -> str:
    """Return the interval of thresholds around ``bound``, above 0, that lead to the same verdict, in words.

    ``verdict_at`` returns the verdict for a threshold. It is called for about fifty thresholds, and for about ten more
    between two thresholds with different verdicts.
    """

    def asked(threshold: float) -> str:
        """Return a separate verdict for thresholds without data."""
        try:
            return verdict_at(threshold)
        except Undecided:
            return "undecided"

    low, high = (_last(asked, bound, way) for way in (-1, 1))
    if low is None and high is None:
        return f"threshold {short(bound)}; any other gives the same verdict"
    start = "" if low is None else f" from {short(low)}"
    end = " up" if high is None else f" up to {short(high)}" if low is None else f" to {short(high)}"
    return f"threshold {short(bound)}; the same verdict{start}{end}"


def _last(asked: Callable[[float], str], bound: float, way: int) -> float | None:
    """Return the last threshold with an equal verdict in one direction, to a hundredth; None if it never changes."""
    verdict, inside = asked(bound), bound
    for factor in _factors():
        outside = bound * factor**way
        if asked(outside) == verdict:
            inside = outside
            continue
        while max(inside, outside) > 1.001 * min(inside, outside):
            middle = (inside * outside) ** 0.5
            inside, outside = (middle, outside) if asked(middle) == verdict else (inside, middle)
        return inside
    return None


def _factors() -> Iterator[float]:
    yield from (_STEP**k for k in range(1, _CLOSE + 1))
    factor = 100.0
    while factor <= _FARTHEST:
        yield factor
        factor *= factor
