"""A statement of the paper that numbers decide, and what they say of it.

A statement is a function below :func:`claim` in a file of its group; nothing else lists it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from nearharmonic.claims.results import Results, Undecided
from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.store import workflow_command

Verdict = Literal["holds", "holds in part", "fails", "not decided here"]


class Decision(NamedTuple):
    """What became of a statement, and what was measured, in words and numbers."""

    verdict: Verdict
    value: str


Decide = Callable[[Results], Decision]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement.

    Attributes
    ----------
    id : str
        Name in tables, lower case with hyphens.
    paper : str
        Where the paper says it.
    statement : str
        Its words in short.
    threshold : str
        What is asked of the numbers, and where the numbers in it come from.
    needs : tuple of str
        Result files that it is decided on, relative to the folder of results.
    target : str
        Target of the workflow that makes these files.
    also : tuple of str
        Result files of other targets. Where they are there, the value tells something from them; the verdict does not
        depend on them.
    decide : callable
        Takes :class:`~nearharmonic.claims.results.Results` to a :class:`Decision`.
    """

    id: str
    paper: str
    statement: str
    threshold: str
    needs: tuple[str, ...]
    target: str
    decide: Decide
    also: tuple[str, ...] = ()

    def decision(self, results: Results) -> Decision:
        """Decide the statement on ``results``; what is not there leaves it undecided.

        Raises
        ------
        ResultFileError
            A file is damaged, or lacks what the statement needs.
        """
        missing = [name for name in self.needs if not results.has(name)]
        if missing:
            return Decision("not decided here", f"{missing[0]} is not there: target {self.target}")
        try:
            return self.decide(results)
        except Undecided as reason:
            return Decision("not decided here", str(reason))
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            if isinstance(error, NearharmonicError) or not self.needs:
                raise
            message = f"{' or '.join(self.needs)} lacks what {self.id!r} is decided on, or holds no numbers"
            again = f"{workflow_command(results.folder / self.needs[0])} --force {self.target}"
            raise ResultFileError(f"{message}. Make it again: {again}") from error


def claim(
    *, id: str, paper: str, statement: str, threshold: str, needs: Sequence[str] = (), target: str = "all",
    also: Sequence[str] = (),
) -> Callable[[Decide], Claim]:  # fmt: skip
    """Make the decorated function a statement; arguments are the attributes of :class:`Claim`."""

    def decorate(decide: Decide) -> Claim:
        return Claim(
            id=id,
            paper=paper,
            statement=statement,
            threshold=threshold,
            needs=tuple(needs),
            target=target,
            decide=decide,
            also=tuple(also),
        )

    return decorate


def either(good: bool, value: str) -> Decision:
    """Say that a statement holds or fails."""
    return Decision("holds" if good else "fails", value)


def counted(good: Sequence[bool], value: str) -> Decision:
    """Say that a statement of several things holds, holds in part or fails: all, some or none of them are good."""
    return Decision("holds" if all(good) else "holds in part" if any(good) else "fails", value)


def combined(verdicts: Iterable[Verdict], value: str) -> Decision:
    """Say that a statement of several parts holds or fails if all of them do, and holds in part otherwise."""
    found = set(verdicts)
    return Decision(found.pop() if len(found) == 1 else "holds in part", value)
