"""The tables of docs/results/training.md: the trained methods, how much of the landscape was seen, shifted kicks."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from nearharmonic.integrators import integrators as registered
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.theory.linear_stability import stability_limit
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.theory.oscillator import shifted_kicks
from nearharmonic_studies.trained.problems.purposes import PURPOSES

#: Methods of the table of shifted kicks beside the trained ones: those of the paper, and where such pairs are as plain.
SHIFTED = ("aba104", "abas5o6h", "babs6o5h", "babps6o5h", "babps8o7h", "mclachlan_sb3a4")


def trained() -> list[Tableau]:
    """Return all trained methods, those with kicks of a modified potential last."""
    found = [registered[name] for name in registered.registered if name.startswith("trained_")]
    return sorted(found, key=lambda one: one.modified)


def composition(tableau: Tableau) -> str:
    """ABA or BAB."""
    return "BAB" if tableau.first == "kick" else "ABA"


def methods_table() -> list[str]:
    """Return a row for each trained method: its proved properties and its window."""
    rows = []
    for one in trained():
        purpose = PURPOSES[one.name.removeprefix("trained_")]
        low, high = purpose.window
        total = sum(abs(float(c)) for c in (*one.kick, *one.drift))
        told = ["", f"{order_of(one)}", "", ""]
        if not one.modified:
            told = [
                f"{order_of(one)}", f"{nystrom_order_of(one)}", f"{harmonic_order(one)}",
                f"{float(stability_limit(one)):.3f}",
            ]  # fmt: skip
        cells = [f"`{one.name}`", purpose.what, f"{low:.3g} to {high:.3g}", composition(one), str(one.stages), *told]
        rows.append([*cells, f"{total:.2f}"])
    columns = ["composition", "stages", "order", "for quadratic T", "harmonic", "stable up to τ", "Σ abs"]
    return pipes(["method", "for", "τ/s", *columns], rows, align="llllr")


def shifted_table() -> list[str]:
    """Return a row for each method with shifted kicks: the first of its mirrored pairs."""
    rows = []
    for one in [*(registered[name] for name in SHIFTED), *trained()]:
        found = [] if one.modified else shifted_kicks(one)
        if found:
            pair = found[0]
            numbers = [pair.before, pair.drift, pair.behind, pair.net, pair.square]
            cells = [one.label, *(f"{x:.4f}".replace("-", "−") for x in numbers[:-1]), f"{pair.square:.5f}"]
            rows.append(cells)
    return pipes(["method", "a", "d", "b", "a + b", "m"], rows, align="lr")


def landscape_table(landscapes: Mapping[str, str]) -> list[str]:
    """Return a row for each family that was searched, from the path of a table for each purpose."""
    rows = []
    for name, purpose in PURPOSES.items():
        if name not in landscapes:
            continue
        with Path(landscapes[name]).open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                squares = f", squares {row['squares']}" if row["squares"] else ""
                cells = [
                    purpose.what, row["composition"] + squares, row["stages"], row["searches"], row["methods tried"],
                    row["ended at the best"], row["best from"], f"{float(row['least gain']):.2f}",
                    f"{float(row['mean gain']):.2f}",
                ]  # fmt: skip
                rows.append([cell.replace("-", "−") for cell in cells])
    columns = ["stages", "searches", "methods tried", "at the best", "best from", "gain, least", "mean"]
    return pipes(["for", "composition", *columns], rows, align="llrrrrlr")


def parts(landscapes: Mapping[str, str]) -> dict[str, str]:
    """Return the tables by their marks on the page; ``landscapes`` has paths by purpose."""
    found = {"methods": methods_table(), "shifted": shifted_table(), "landscape": landscape_table(landscapes)}
    return {name: "\n".join(["", *lines, ""]) for name, lines in found.items()}


def page(page: str, integrators: Sequence[str], **landscapes: str) -> dict[str, str]:
    """Fill the page. ``landscapes`` are paths of tables by purpose."""
    return {"page": filled_page(page, parts(landscapes))}
