"""Statements of the paper that numbers can decide: their data, their decisions, and numbers of verdicts.

A statement is a :class:`Claim` in the file of its group; there is no other list. The decorator of its kind, for
example :data:`result`, takes its words and its threshold, and the function below it decides. The name of the function,
with hyphens, is the id. Statements with a common method of decision are rows of a tuple, with an ``id`` each:
``result(...)(partial(judge, ...))``, where the parameters of the row come before the results.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, ParamSpec, TypeVar, get_args

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import read, workflow_command
from nearharmonic.output.table import power_of_ten, short
from nearharmonic_paper.record.manifest import Texts
from nearharmonic_paper.tasks.experiment import experiments

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Results", "Undecided", "label", "only", "power_of_ten", "require", "short"]


Given = ParamSpec("Given")
Found = TypeVar("Found")


# --- Data for decisions: the files of one folder of results, each read once, and the methods. -------------------------


class Undecided(Exception):
    """The results lack the data of a statement; the message names them."""


def require(known: object, lacking: str) -> None:
    """Raise :class:`Undecided` with the message ``lacking`` if ``known`` is false or empty."""
    if not known:
        raise Undecided(lacking)


def once(make: Callable[Given, Found]) -> Callable[Given, Found]:
    """Return a function that keeps the values of ``make`` in its first argument, which is results or curves."""

    @wraps(make)
    def kept(*given: Given.args, **named: Given.kwargs) -> Found:
        values: dict[Any, Found] = given[0].__dict__.setdefault("kept", {})
        key = (make, *given[1:], *named.items())
        if key not in values:
            values[key] = make(*given, **named)
        return values[key]

    return kept


class Results:
    """A folder of results. A file that is missing, damaged or without rows is a ResultFileError.

    ``methods`` are the methods of the statements, by default the registered splitting methods. ``leftovers`` are files
    that count as missing.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        methods: Mapping[str, Tableau] | None = None,
        leftovers: Sequence[str] = (),
    ) -> None:
        self._leftovers = leftovers
        self.folder = Path(folder)
        self._texts = Texts(self.folder)
        self.methods: Mapping[str, Tableau] = plain_integrators if methods is None else methods

    def has(self, name: str) -> bool:
        """Return True if the file ``name``, relative to the folder, exists and is no leftover."""
        return name not in self._leftovers and (self.folder / name).is_file()

    @once
    def cube(self, stem: str) -> xr.Dataset:
        """Return the cube of this name, only with the methods of the statements."""
        cube = self._read_cube(stem)
        if "integrator" not in cube.dims:
            return cube
        return cube.isel(integrator=[str(name) in self.methods for name in cube["integrator"].values])

    def _read_cube(self, stem: str) -> xr.Dataset:
        return read(self.folder / f"cubes/{stem}.h5")

    @once
    def rows(self, stem: str) -> list[dict[str, str]]:
        """Return the rows of the table of this name without other methods, each cell a text by its column."""
        known = {"", *self.methods}
        return [row for row in self._read_rows(stem) if row.get("integrator", "") in known]

    def _read_rows(self, stem: str) -> list[dict[str, str]]:
        name = f"tables/{stem}.csv"
        rows = self._texts.table(name).records()
        if not rows:
            raise self._texts.unusable(name, "holds no row")
        return rows

    @cached_property
    def derived(self) -> dict[str, Any]:
        """The document ``derived/coefficients.toml``."""
        name = "derived/coefficients.toml"
        text = self._texts.read(name)
        try:
            return tomllib.loads(text)
        except ValueError as error:
            raise self._texts.unusable(name, "is no TOML") from error

    def method(self, name: str) -> Tableau:
        """Return a method by its name, if it is among the methods; raise :class:`Undecided` otherwise."""
        require(name in self.methods, f"the method {name} is not among the selected methods")
        return self.methods[name]

    @once
    def panels(self) -> dict[str, xr.Dataset]:
        """Return the panels of Figure 6, by letter."""
        from nearharmonic_paper.experiments.paper.orbits import paper_panels

        return paper_panels()


def only(rows: Sequence[Mapping[str, str]], key: str, value: str) -> Mapping[str, str]:
    """Return the row with ``value`` under ``key``; raise :class:`Undecided` if there is none."""
    found = [row for row in rows if row[key] == value]
    require(found, f"the table has no {key} {value}")
    return found[0]


def label(name: str) -> str:
    """Return the label of a method, or its name if it is not registered."""
    return integrators[name].label if name in integrators else name


# --- Margins: the range of thresholds of a statement that leave its verdict unchanged. --------------------------------

#: The margin of proofs, counts and comparisons of digits.
EXACT = "exact; no numerical threshold"
#: Successive factors of a threshold: in steps of 12 % up to ten, then by squares.
FACTORS = (*(10 ** (k / 20) for k in range(1, 21)), *(10.0**2**k for k in range(1, 8)))


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

    def last(way: int) -> float | None:
        """Return the last threshold with an equal verdict in one direction, to a thousandth; None if none differs."""
        inside = bound
        for factor in FACTORS:
            outside = bound * factor**way
            if asked(outside) != verdict:
                while max(inside, outside) > 1.001 * min(inside, outside):
                    middle = (inside * outside) ** 0.5
                    inside, outside = (middle, outside) if asked(middle) == verdict else (inside, middle)
                return inside
            inside = outside
        return None

    verdict = asked(bound)
    low, high = map(last, (-1, 1))
    if low is None and high is None:
        return f"threshold {short(bound)}; any other threshold gives the same verdict"
    start = "" if low is None else f" from {short(low)}"
    end = " upwards" if high is None else f" up to {short(high)}" if low is None else f" to {short(high)}"
    return f"threshold {short(bound)}; the verdict is the same{start}{end}"


# --- Statements and decisions. ----------------------------------------------------------------------------------------

Verdict = Literal["holds", "holds but for edges", "holds in part", "fails", "erratum", "not decided here"]
OPEN: Verdict = "not decided here"

#: Kinds of statements. A result is measured or found in the paper. Mathematics is proved in the paper or follows.
#: A misprint can be corrected from its context. An attribution names an author. Background is quoted from other papers
#: or describes the compared objects. A finding is a statement of this project, not of the paper.
Kind = Literal["result", "mathematics", "misprint", "attribution", "background", "finding"]


class Decision(NamedTuple):
    """Verdict on a statement, measured value in words and numbers, margin of the threshold, short value for README."""

    verdict: Verdict
    value: str
    margin: str = ""
    brief: str = ""


#: Function of the results, and of the threshold if it is a number.
Decide = Callable[..., Decision]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement: its name in tables, its position in the paper, the words of the paper, and their interpretation."""

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
    def target(self) -> str:
        """Workflow target that makes the files in ``needs``."""
        return maker_of(self.needs)[0]

    def decision(self, results: Results) -> Decision:
        """Decide the statement on ``results``; missing data leave it undecided.

        A file that is damaged, or lacks what the statement needs, is a ResultFileError.
        """
        missing = [name for name in self.needs if not results.has(name)]
        if missing:
            return Decision(OPEN, "target {} decides it ({})".format(*maker_of(self.needs)))
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


def _statement(kind: Kind, **attributes: Any) -> Callable[[Decide], Claim]:
    """Return the decorator of a function that decides a statement of one kind, with the other attributes."""

    def decorated(decide: Decide) -> Claim:
        given = {"id": getattr(decide, "__name__", "").replace("_", "-"), **attributes}
        return Claim(**given, kind=kind, decide=decide)

    return decorated


#: The decorators of functions that decide statements, one for each kind.
result, mathematics, misprint, attribution, background, finding = (partial(_statement, one) for one in get_args(Kind))


def either(good: bool, value: str) -> Decision:
    """Return the decision that a statement holds or fails."""
    return Decision("holds" if good else "fails", value)


def counted(good: Sequence[bool], value: str, brief: str = "") -> Decision:
    """Return the decision on several objects: holds, in part or fails, if all, some or no objects are good."""
    return Decision("holds" if all(good) else "holds in part" if any(good) else "fails", value, brief=brief)


def tallied(good: Iterable[bool], things: str, beside: str = "") -> Decision:
    """Decide as :func:`counted`; the value is the number of good ``things``, the number of all, and ``beside``."""
    found = list(good)
    return counted(found, f"{sum(found)} of {len(found)} {things}{beside}")


def combined(verdicts: Iterable[Verdict], value: str, brief: str = "") -> Decision:
    """Return the decision on a statement of several parts.

    It holds or fails if all parts do. It holds but for edges if all parts hold at least but for edges. Otherwise it
    holds in part.
    """
    found = set(verdicts)
    verdict: Verdict = "holds but for edges" if found == {"holds", "holds but for edges"} else "holds in part"
    return Decision(found.pop() if len(found) == 1 else verdict, value, brief=brief)


# --- Number of statements by kind and verdict, in a table and in a sentence. ------------------------------------------

Entry = Mapping[str, Any]

#: Kinds in the order of their weight, with plurals; findings are not counted, because they are not in the paper.
KINDS = {
    "result": "results", "mathematics": "mathematics", "background": "background", "attribution": "attributions",
    "misprint": "misprints",
}  # fmt: skip
FINDING = "finding"
#: Verdicts, with plurals.
VERDICTS = {
    "holds": "hold",
    "holds but for edges": "hold but for edges",
    "holds in part": "hold in part",
    "fails": "fail",
    "erratum": "are errata",
    OPEN: "are not decided here",
}
#: Kinds whose failures are failures of substance.
SUBSTANCE = ("result", "mathematics")


def of_the_paper(entries: Iterable[Entry]) -> list[Entry]:
    """Return the statements of the paper: all except findings."""
    return [entry for entry in entries if entry["kind"] != FINDING]


def sums(entries: Sequence[Entry]) -> list[tuple[str, int, dict[str, int]]]:
    """Return each kind, the number of its statements, and the number of its statements with each verdict."""
    found = []
    for kind, many in KINDS.items():
        verdicts = Counter(entry["verdict"] for entry in entries if entry["kind"] == kind)
        if verdicts:
            found.append((many, verdicts.total(), {verdict: verdicts[verdict] for verdict in VERDICTS}))
    return found


def tally(entries: Sequence[Entry]) -> str:
    """Return the number of statements of the paper, and the number with each verdict, in words."""
    counted = of_the_paper(entries)
    return f"Of {len(counted)} statements of the paper, {in_words(Counter(entry['verdict'] for entry in counted))}"


def in_words(found: Mapping[str, int]) -> str:
    """Return the numbers of statements by verdict in words: 1 holds, 2 are errata."""
    told = ((found[verdict], verdict if found[verdict] == 1 else many) for verdict, many in VERDICTS.items())
    return ", ".join(f"{number} {words}" for number, words in told if number)


def failures(entries: Iterable[Entry]) -> list[Entry]:
    """Return the statements that fail in substance: misprints and attributions are no failures of a method."""
    return [entry for entry in entries if entry["verdict"] == "fails" and entry["kind"] in SUBSTANCE]


def maker_of(needs: Sequence[str]) -> tuple[str, str]:
    """Return the target of the workflow for the files that a statement needs, and its time on two cores."""
    every = experiments()
    maker = next((one for one in every.values() if any(map(one.makes, needs))), every["paper"])
    return maker.cubes_target, maker.cubes_duration


def deciders(entries: Iterable[Entry]) -> list[tuple[str, str]]:
    """Return the targets that decide the open statements of the paper, with their times on two cores."""
    return sorted({maker_of(entry["needs"]) for entry in of_the_paper(entries) if entry["verdict"] == OPEN})


def verdicts_line(document: str | Path, command: str) -> str:
    """Return a line on the verdicts in ``tables/claims.json``, and the command that decides the open statements."""
    entries = json.loads(Path(document).read_text(encoding="utf-8"))
    said, missing = tally(entries), deciders(entries)
    targets = {target: time for target, time in missing if target != "all"}
    which, times = "them" if len(targets) == len(missing) else "most of them", ", ".join(targets.values())
    # Behind --configfile Snakemake would take the targets for further files.
    command = command.replace("-j2", f"-j2 {' '.join(targets)}", 1)
    return f"{said}; {command} decides {which} ({times})" if targets else said
