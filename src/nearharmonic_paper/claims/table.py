"""All statements, decided on a folder of results, as a table and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from nearharmonic.integrators import plain_integrators as registered
from nearharmonic.output.table import Table
from nearharmonic_paper.claims.claim import Claim
from nearharmonic_paper.claims.own import claims_in, own_claims
from nearharmonic_paper.claims.results import Results
from nearharmonic_paper.claims.statements.equations import decomposition, identities, misprints, search
from nearharmonic_paper.claims.statements.figures import henon_heiles, kepler, oscillator, substeps
from nearharmonic_paper.claims.statements.performance import comparisons, discussion
from nearharmonic_paper.claims.statements.tableaus import coefficients, methods, roles, sizes, splitting, trained

#: The groups in the order of the paper; the digest of the job covers these imports, so that an edit invalidates
#: decisions.
GROUPS = (
    splitting, decomposition, identities, misprints, search, coefficients, sizes, trained, roles, methods, oscillator,
    henon_heiles, kepler, substeps, comparisons, discussion,
)  # fmt: skip


CLAIMS: tuple[Claim, ...] = tuple(one for group in GROUPS for one in claims_in(group))

#: Result files for decisions or values of statements, relative to the folder of results.
FILES: tuple[str, ...] = tuple(sorted({name for one in CLAIMS for name in (*one.needs, *one.also)}))

#: Keys of an entry. The entry ``paper`` has the keys ``section`` and ``sentence``.
KEYS = ("id", "paper", "statement", "kind", "verdict", "value", "threshold", "margin", "needs")
#: Columns of the table.
COLUMNS = ("id", "section", "sentence", *KEYS[2:])


def decide(results: Results) -> list[dict[str, Any]]:
    """Return an entry with the keys :data:`KEYS` for every statement, group by group.

    Raises
    ------
    ResultFileError
        A result file is damaged.
    """
    return [_entry(one, results) for one in (*CLAIMS, *own_claims())]


def _entry(one: Claim, results: Results) -> dict[str, Any]:
    found = one.decision(results)
    return {
        "id": one.id,
        "paper": {"section": one.paper, "sentence": one.sentence},
        "statement": one.statement,
        "kind": one.kind,
        "verdict": found.verdict,
        "value": found.value,
        "threshold": one.threshold,
        "margin": found.margin,
        "needs": list(one.needs),
    }


def decided(
    folder: str | os.PathLike[str], integrators: Sequence[str] | None = None, leftovers: Sequence[str] = ()
) -> dict[str, Table | str]:
    """Decide every statement.

    Parameters
    ----------
    folder : path
        The folder of results.
    integrators : sequence of str, optional
        Names of the methods for statements about all methods; by default every registered splitting method. Methods of
        a user's config are not included, so that they change no verdict.
    leftovers : sequence of str
        Names of files of another config, which decide nothing.

    Returns
    -------
    dict
        ``table``, and ``document``, the JSON text of a list of objects with the keys :data:`KEYS`.

    Raises
    ------
    ResultFileError
        A result file is damaged.
    """
    methods_by_name = {name: registered[name] for name in (registered if integrators is None else integrators)}
    entries = decide(Results(folder, methods_by_name, leftovers))
    rows = [[entry["id"], *entry["paper"].values(), *_cells(entry)] for entry in entries]
    caption = "Statements of the paper, and what the numbers say of them."
    text = json.dumps(entries, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return {"table": Table(header=COLUMNS, rows=rows, caption=caption), "document": text}


def _cells(entry: Mapping[str, Any]) -> list[str]:
    return [", ".join(entry[key]) if key == "needs" else entry[key] for key in KEYS[2:]]
