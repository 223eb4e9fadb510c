"""All statements, decided on a folder of results, as a table and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from nearharmonic.integrators import plain_integrators as registered
from nearharmonic.output.table import Table
from nearharmonic_paper.claims import equations, figures, performance, splitting, tableaus
from nearharmonic_paper.claims.claim import Claim, Results
from nearharmonic_paper.tasks.experiment import folders
from nearharmonic_paper.tasks.provenance import ROOT, code_digest, path_of


# --- Statements of experiments, found in the modules ``claims`` of their folders.
def modules() -> list[str]:
    """Return the dotted names of the modules with statements."""
    return [name for name in (f"{folder}.claims" for folder in folders()) if path_of(name, ROOT).is_file()]


def digest() -> str:
    """Return the SHA-256 of the code of these modules, which the digest of the deciding job does not cover."""
    return code_digest(*modules())


@cache
def own_claims() -> tuple[Claim, ...]:
    """Return the statements in the order of their modules."""
    return tuple(one for name in modules() for one in claims_in(import_module(name)))


def claims_in(module: ModuleType) -> Iterator[Claim]:
    """Yield the statements of a module in their order, including those in tuples."""
    for value in vars(module).values():
        rows = value if isinstance(value, tuple) else (value,)
        yield from (one for one in rows if isinstance(one, Claim))


#: All statements in the order of the paper; the digest of the job covers these imports, so that an edit invalidates
#: decisions.
CLAIMS: tuple[Claim, ...] = tuple(
    claim for group in (splitting, equations, tableaus, figures, performance) for claim in claims_in(group)
)

#: Result files for decisions or values of statements, relative to the folder of results.
FILES: tuple[str, ...] = tuple(sorted({name for claim in CLAIMS for name in (*claim.needs, *claim.also)}))

#: Keys of an entry, and columns of the table, which has ``section`` and ``sentence`` in place of ``paper``.
KEYS = ("id", "paper", "statement", "kind", "verdict", "value", "threshold", "margin", "needs")
COLUMNS = ("id", "section", "sentence", *KEYS[2:])


def decide(results: Results) -> list[dict[str, Any]]:
    """Return an entry with :data:`KEYS` and ``brief`` for each statement; a damaged file is a ResultFileError."""
    entries = []
    for claim in (*CLAIMS, *own_claims()):
        told = vars(claim) | claim.decision(results)._asdict() | {"needs": list(claim.needs)}
        told["paper"] = {"section": claim.paper, "sentence": claim.sentence}
        entries.append({key: told[key] for key in (*KEYS, "brief")})
    return entries


def document(entries: Sequence[Mapping[str, Any]]) -> str:
    """Return the JSON text of entries, a list of objects with :data:`KEYS`."""
    told = [{key: entry[key] for key in KEYS} for entry in entries]
    return json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def results_of(
    folder: str | os.PathLike[str], integrators: Sequence[str] | None = None, leftovers: Sequence[str] = ()
) -> Results:
    """Return a folder of results with the methods of these names, by default every registered splitting method."""
    names = registered if integrators is None else integrators
    return Results(folder, {name: registered[name] for name in names}, leftovers)


def decided(
    folder: str | os.PathLike[str], integrators: Sequence[str] | None = None, leftovers: Sequence[str] = ()
) -> dict[str, Table | str]:
    """Decide every statement: ``table``, and ``document``, the JSON text of a list of objects with :data:`KEYS`.

    ``integrators`` are the methods for statements about all methods; by default every registered splitting method.
    Methods of a user's config are not included, so that they change no verdict. ``leftovers`` are files of another
    config, which decide nothing.
    """
    entries = decide(results_of(folder, integrators, leftovers))
    flat = [{**entry, **entry["paper"], "needs": ", ".join(entry["needs"])} for entry in entries]
    caption = "Statements of the paper and their verdicts."
    table = Table(header=COLUMNS, rows=[[entry[column] for column in COLUMNS] for entry in flat], caption=caption)
    return {"table": table, "document": document(entries)}
