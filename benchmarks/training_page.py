"""The tables of docs/training.md: the trained methods, how much of the landscape was seen, shifted kicks.

Run: ``python benchmarks/training_page.py [results/paper]`` behind ``snakemake trained``; without a folder of results
the table of the landscape stays as it is.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.output.page import filled, pipes
from nearharmonic.reproduction.experiments.trained.problems.purposes import PURPOSES
from nearharmonic.theory.shifted_kicks import shifted_kicks

PAGE = Path(__file__).parents[1] / "docs/training.md"
#: Methods of the table of shifted kicks beside the trained ones: those of the paper, and where such pairs are as plain.
SHIFTED = ("aba104", "abas5o6h", "babs6o5h", "babps6o5h", "babps8o7h", "mclachlan_sb3a4")


def trained() -> list[nh.Tableau]:
    """All trained methods, those with kicks of a modified potential last."""
    plain = [one for name, one in plain_integrators.items() if name.startswith("trained_")]
    return plain + [one for name, one in nh.modified_integrators.items() if name.startswith("trained_")]


def composition(tableau: nh.Tableau) -> str:
    """ABA or BAB."""
    return "BAB" if tableau.first == "kick" else "ABA"


def methods_table() -> list[str]:
    """A row for each trained method: what is proved of it, and its window."""
    rows = []
    for one in trained():
        purpose = PURPOSES[one.name.removeprefix("trained_")]
        low, high = purpose.window
        total = sum(abs(float(c)) for c in (*one.kick, *one.drift))
        told = ["", f"{nh.order_of(one)}", "", ""]
        if not one.modified:
            orders = nh.theory.order
            told = [
                f"{nh.order_of(one)}", f"{orders.nystrom_order_of(one)}", f"{orders.harmonic_order_of(one)}",
                f"{float(nh.stability_limit(one)):.3f}",
            ]  # fmt: skip
        cells = [f"`{one.name}`", purpose.what, f"{low:.3g} to {high:.3g}", composition(one), str(one.stages), *told]
        rows.append([*cells, f"{total:.2f}"])
    columns = ["composition", "stages", "order", "for quadratic T", "harmonic", "stable up to τ", "Σ abs"]
    return pipes(["method", "for", "τ/s", *columns], rows, align="llllr")


def shifted_table() -> list[str]:
    """A row for each method with shifted kicks: the first of its mirrored pairs."""
    rows = []
    for one in [*(nh.integrators[name] for name in SHIFTED), *trained()]:
        found = [] if one.modified else shifted_kicks(one)
        if found:
            pair = found[0]
            numbers = [pair.before, pair.drift, pair.behind, pair.net, pair.square]
            cells = [one.label, *(f"{x:.4f}".replace("-", "−") for x in numbers[:-1]), f"{pair.square:.5f}"]
            rows.append(cells)
    return pipes(["method", "a", "d", "b", "a + b", "m"], rows, align="lr")


def landscape_table(results: Path) -> list[str]:
    """A row for each family that was searched."""
    rows = []
    for name, purpose in PURPOSES.items():
        with (results / f"tables/trained_landscape_{name}.csv").open(encoding="utf-8", newline="") as file:
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


def parts(results: Path | None = None) -> dict[str, str]:
    """The tables by their marks on the page."""
    found = {"methods": methods_table(), "shifted": shifted_table()}
    if results:
        found["landscape"] = landscape_table(results)
    return {name: "\n".join(["", *lines, ""]) for name, lines in found.items()}


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, nargs="?", help="folder of results, for the table of the landscape")
    asked = parser.parse_args()
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), parts(asked.results)), encoding="utf-8")


if __name__ == "__main__":
    main()
