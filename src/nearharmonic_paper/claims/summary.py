"""Number of statements by kind and verdict, in a table and in a sentence."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic_paper.claims.claim import OPEN

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
    """Return each kind, the number of its statements, and the number of them with each verdict."""
    found = []
    for kind, many in KINDS.items():
        verdicts = Counter(entry["verdict"] for entry in entries if entry["kind"] == kind)
        if verdicts:
            found.append((many, verdicts.total(), {verdict: verdicts[verdict] for verdict in VERDICTS}))
    return found


def tally(entries: Sequence[Entry]) -> str:
    """Return the number of statements of the paper and of those with each verdict, in words."""
    counted = of_the_paper(entries)
    told = in_words(Counter(entry["verdict"] for entry in counted))
    return f"Of the {len(counted)} statements of the paper that are checked {told}"


def in_words(found: Mapping[str, int]) -> str:
    """Return the numbers of statements by verdict in words: 1 holds, 2 are errata."""
    told = ((found[verdict], verdict if found[verdict] == 1 else many) for verdict, many in VERDICTS.items())
    return ", ".join(f"{number} {words}" for number, words in told if number)


def failures(entries: Iterable[Entry]) -> list[Entry]:
    """Return the statements that fail in substance: misprints and attributions are no failures of a method."""
    return [entry for entry in entries if entry["verdict"] == "fails" and entry["kind"] in SUBSTANCE]


def verdicts_line(document: str | Path, command: str) -> str:
    """Return a line on the verdicts in ``tables/claims.json``, and the command that decides the open statements."""
    from nearharmonic_paper.claims.table import CLAIMS, own_claims

    entries = json.loads(Path(document).read_text(encoding="utf-8"))
    makers = {one.id: one.maker for one in (*CLAIMS, *own_claims())}
    missing = {makers[entry["id"]] for entry in of_the_paper(entries) if entry["verdict"] == OPEN}
    later = sorted((target, time) for target, time in missing if target != "all")
    if not later:
        return f"{tally(entries)}."
    share = "all" if len(later) == len(missing) else "most"
    targets, times = zip(*later, strict=True)
    # Behind --configfile Snakemake would take the targets for further files.
    program, option, files = command.partition(" --configfile")
    command = f"{program} {' '.join(targets)}{option}{files}"
    return f"{tally(entries)}; {command} decides {share} of those left open ({', '.join(times)})."
