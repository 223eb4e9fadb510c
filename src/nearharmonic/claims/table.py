"""All statements, decided on a folder of results, as a table and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from nearharmonic.claims.claim import Claim
from nearharmonic.claims.results import Results
from nearharmonic.claims.statements import (
    coefficients,
    comparisons,
    conclusions,
    decomposition,
    henon_heiles,
    identities,
    kepler,
    methods,
    oscillator,
    roles,
    rounding,
    search,
    splitting,
    substeps,
    trained,
)
from nearharmonic.integrators import integrators as registered
from nearharmonic.output.table import Table

#: The groups in the order of the paper; a digest of the job follows these imports, so that an edit of one decides anew.
GROUPS = (
    splitting, decomposition, identities, search, coefficients, trained, roles, methods, rounding, oscillator,
    henon_heiles, kepler, substeps, comparisons, conclusions,
)  # fmt: skip

CLAIMS: tuple[Claim, ...] = tuple(one for group in GROUPS for one in vars(group).values() if isinstance(one, Claim))

#: Result files that a statement may need or tell of, relative to the folder of results.
FILES: tuple[str, ...] = tuple(sorted({name for one in CLAIMS for name in (*one.needs, *one.also)}))

#: Keys of an entry, and columns of the table.
KEYS = ("id", "paper", "statement", "verdict", "value", "threshold", "needs")


def decide(results: Results) -> list[dict[str, Any]]:
    """Return an entry with the keys :data:`KEYS` for every statement, group by group.

    Raises
    ------
    ResultFileError
        A result file is damaged.
    """
    entries = []
    for one in CLAIMS:
        verdict, value = one.decision(results)
        told = (one.id, one.paper, one.statement, verdict, value, one.threshold, list(one.needs))
        entries.append(dict(zip(KEYS, told, strict=True)))
    return entries


def decided(folder: str | os.PathLike[str], integrators: Sequence[str] | None = None) -> dict[str, Table | str]:
    """Decide every statement.

    Parameters
    ----------
    folder : path
        The folder of results.
    integrators : sequence of str, optional
        Names of the methods that statements about all methods look at; every registered one by default.

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
    entries = decide(Results(folder, methods_by_name))
    rows = [[", ".join(e[key]) if key == "needs" else e[key] for key in KEYS] for e in entries]
    caption = "Statements of the paper, and what the numbers say of them."
    text = json.dumps(entries, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return {"table": Table(header=KEYS, rows=rows, caption=caption), "document": text}
