"""The tables of docs/results/derivation.md, from the tables of the target ``derive``."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.integrators import integrators as registered
from nearharmonic.output.page import filled_page
from nearharmonic_paper.claims.results import short
from nearharmonic_paper.pages.trained import Row, Tables, table, tables_of

#: Stages and step size per stage at which the isolated solutions are compared.
STAGES, TAU_PER_STAGE = 5, 0.05
#: Decimals of coefficients by which a solution is recognised, and the isolated sets of the paper with these stages.
DIGITS, ISOLATED = 8, ("abas5o6h", "abas5o6h_b", "abas5o6h_c")


def counts(tables: Tables) -> str:
    """Return a row for each number of stages whose solutions are isolated."""
    header = ("stages", "harmonic order", "complex solutions", "real solutions")
    columns = ("stages", "harmonic order", "complex solutions", "real solutions by Sturm")
    return table(header, ([f"{row[key]:g}" for key in columns] for row in tables["counts"]), left=0)


def solutions(tables: Tables) -> str:
    """Return a row for each solution with five stages: its coefficients, its name in the paper and its error."""
    errors = {row["solution"]: row for row in tables["errors"] if row["tau/s"] == TAU_PER_STAGE}
    rows = []
    for row in tables["solutions"]:
        if row["stages"] == STAGES:
            halves = (shown(row[f"half of the {part} row"]) for part in ("outer", "inner"))
            rows.append((*halves, name(row), short(errors[row["solution"]]["max error, harmonic oscillator"], 2)))
    return table(("outer row", "inner row", "in the paper", "error"), rows, left=3)


def shown(half: str) -> str:
    """The independent coefficients of half of a row: the middle ones of the odd row follow from the sum."""
    return ", ".join(f"{float(c):.4f}".replace("-", "\N{MINUS SIGN}") for c in half.split()[:2])


def name(row: Row) -> str:
    """The name that the paper gives to a solution; empty if it has none."""
    for one in ISOLATED:
        rows = registered[one].drift, registered[one].kick
        halves = {" ".join(f"{float(c):.{DIGITS}f}" for c in half[: (len(half) + 1) // 2]) for half in rows}
        if halves == {row["half of the outer row"], row["half of the inner row"]}:
            return registered[one].label
    return ""


def families(tables: Tables) -> str:
    """Return a row for each printed set with free parameters: its place in its family."""
    header = ("set", "free parameters", "members found", "smaller sum", "smaller next error")
    rows = []
    for row in tables["families"]:
        shares = (row[f"members with a smaller {what}"] for what in ("sum", "next kappa"))
        found = (f"{row[key]:g}" for key in ("free parameters", "members found"))
        rows.append((row["set"], *found, *(f"{100 * share:.2g} %" for share in shares)))
    return table(header, rows)


def route(tables: Tables) -> str:
    """Return in a sentence what the simplex of the paper reaches from random starts."""
    runs = [row for row in tables["routes"] if str(row["route"]).startswith("adaptive simplex")]
    reached = [str(row["reached"]) for row in runs if str(row["reached"]).startswith("solution")]
    names = {f"solution {row['solution']:g}": name(row) for row in tables["solutions"] if row["stages"] == STAGES}
    found = sorted({names[one] or "one without a name" for one in reached})
    starts = " and ".join(sorted({str(row["start"]).removeprefix("random, one of ") for row in runs}))
    return (
        f"A short run selects {starts.replace(' in ', ' of ')} starts. Of these {len(reached)} reach 10⁻¹²⁸. They find "
        f"{len(found)} of the {len(names)} solutions: {', '.join(found)}."
    )


#: Marks of the page, and what stands between them.
PARTS = {"counts": counts, "solutions": solutions, "families": families, "route": route}


def page(page: str, tables: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page: ``tables`` are derived_*.csv."""
    rows = tables_of(tables, "derived_")
    return {"page": filled_page(page, {mark: made(rows) for mark, made in PARTS.items()})}
