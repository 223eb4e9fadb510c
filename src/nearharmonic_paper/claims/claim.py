"""Statements of the paper that can be decided by numbers, and their decisions.

A statement is a row: a :class:`Claim` in a file of its group; there is no other list. The decorator of its kind, for
example :data:`result`, takes its words and its threshold, and the function below it decides. The name of the function,
with hyphens, is the id. Statements with a common method of decision are rows of a tuple, with an ``id`` each:
``result(...)(judge)``, where a function with the parameters of the row returns the judge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.store import workflow_command
from nearharmonic_paper.claims.results import Results, Undecided, short
from nearharmonic_paper.tasks.experiment import experiments

# --- Margins: the range of thresholds of a statement that leave its verdict unchanged.

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


Verdict = Literal["holds", "holds but for edges", "holds in part", "fails", "erratum", "not decided here"]
OPEN: Verdict = "not decided here"

#: Kinds of statements. A result is measured or found in the paper. Mathematics is proved in the paper or follows. A
#: misprint can be corrected from its context. An attribution names an author. Background is quoted from others or
#: describes the compared objects. A finding is a statement of this project, not of the paper.
Kind = Literal["result", "mathematics", "misprint", "attribution", "background", "finding"]


class Decision(NamedTuple):
    """Verdict on a statement, the measured value in words and numbers, and the margin of its threshold."""

    verdict: Verdict
    value: str
    margin: str = ""


#: Function of the results, and of the threshold if it is a number.
Decide = Callable[..., Decision]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement: its name in tables, its position in the paper, the words of the paper, and what is made of them."""

    id: str
    paper: str
    sentence: str
    kind: Kind
    #: The part of the sentence that is decided here, with its interpretation.
    statement: str
    #: Condition on the numbers, and origin of its constants.
    threshold: str
    decide: Decide
    #: The threshold, if it is one number; the margin is the interval of bounds with an equal verdict.
    bound: float | None = None
    #: Result files for the decision, relative to the folder of results.
    needs: tuple[str, ...] = ()
    #: Result files of other targets. If they exist, the value uses them; the verdict does not depend on them.
    also: tuple[str, ...] = ()

    @property
    def maker(self) -> tuple[str, str]:
        """Target of the workflow for its files, and its time on two cores."""
        every = experiments()
        maker = next((one for one in every.values() if any(map(one.makes, self.needs))), every["paper"])
        return maker.cubes_target, maker.cubes_duration

    @property
    def target(self) -> str:
        """Target of the workflow for its files."""
        return self.maker[0]

    def decision(self, results: Results) -> Decision:
        """Decide the statement on ``results``; missing data leave it undecided.

        A file that is damaged, or lacks what the statement needs, is a ResultFileError.
        """
        missing = [name for name in self.needs if not results.has(name)]
        if missing:
            return Decision(OPEN, f"{missing[0]} is not there: target {', '.join(self.maker)}")
        bound = self.bound
        try:
            found = self.decide(results) if bound is None else self.decide(results, bound)
            words = EXACT if bound is None else margin(lambda other: self.decide(results, other).verdict, bound)
        except Undecided as reason:
            return Decision(OPEN, str(reason))
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            if isinstance(error, NearharmonicError) or not self.needs:
                raise
            message = f"{' or '.join(self.needs)} lacks the data that decide {self.id!r}, or contains no numbers"
            again = f"{workflow_command(results.folder / self.needs[0])} --force {self.target}"
            raise ResultFileError(f"{message}. Make it again: {again}") from error
        wrong = self.kind == "misprint" and found.verdict in ("fails", "holds in part")
        return found._replace(verdict="erratum" if wrong else found.verdict, margin=words)


def _statements(kind: Kind) -> Callable[..., Callable[[Decide], Claim]]:
    """Return the decorator of functions that decide statements of one kind; it takes the other attributes."""

    def attributed(**attributes: Any) -> Callable[[Decide], Claim]:
        return lambda decide: Claim(**{"id": decide.__name__.replace("_", "-")} | attributes, kind=kind, decide=decide)

    return attributed


#: The decorators of functions that decide statements, one for each kind.
result, mathematics, misprint = _statements("result"), _statements("mathematics"), _statements("misprint")
attribution, background, finding = _statements("attribution"), _statements("background"), _statements("finding")


def either(good: bool, value: str) -> Decision:
    """Return the decision that a statement holds or fails."""
    return Decision("holds" if good else "fails", value)


def counted(good: Sequence[bool], value: str) -> Decision:
    """Return the decision on several objects: holds, in part or fails, if all, some or none of them are good."""
    return Decision("holds" if all(good) else "holds in part" if any(good) else "fails", value)


def tallied(good: Iterable[bool], things: str, beside: str = "") -> Decision:
    """Decide as :func:`counted`; the value is the number of good things, of all, and the text ``beside``."""
    found = list(good)
    return counted(found, f"{sum(found)} of {len(found)} {things}{beside}")


def combined(verdicts: Iterable[Verdict], value: str) -> Decision:
    """Return the decision on a statement of several parts.

    It holds or fails if all parts do. It holds but for edges if all parts hold at least but for edges. Otherwise it
    holds in part.
    """
    found = set(verdicts)
    if len(found) == 1:
        return Decision(found.pop(), value)
    return Decision("holds but for edges" if found == {"holds", "holds but for edges"} else "holds in part", value)
