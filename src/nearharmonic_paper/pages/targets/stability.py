"""The tables of docs/results/stability.md, from tables of the target ``stability``."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from math import isnan

import numpy as np

from nearharmonic.output.page import filled_page
from nearharmonic_paper.claims.results import short
from nearharmonic_paper.experiments.stability.kinetic_energy.reductions import YARDSTICK
from nearharmonic_paper.pages.trained import Row, Tables, label, table, tables_of

#: What the tables of the target call the sources of rounding errors and quantities, and the page.
SOURCES = {"plain": "plain", "compensated": "compensated", "extended": "double-double"}
QUANTITIES = {"energy_error": "energy", "lag": "phase"}


def limits(tables: Tables) -> str:
    """Return the step sizes up to which trajectories stay, over the linear limit, by method and energy."""
    rows = tables["stability_henon_heiles"]
    energies = list(dict.fromkeys(row["energy"] for row in rows))
    header = ("method", "linear limit, τ/s", *(f"H = {Fraction(H).limit_denominator(1000)}" for H in energies))
    lines = []
    for name, group in groupby(rows, key=lambda row: row["integrator"]):
        shares = {row["energy"]: row for row in group}
        limit = next(iter(shares.values()))["linear_limit_tau_per_stage"]
        lines.append((label(name), f"{limit:.3g}", *(share(shares[H]) for H in energies)))
    return table(header, lines)


def share(row: Row) -> str:
    """The part of the linear limit up to which trajectories stay."""
    found = row["share_of_linear_limit"]
    return "none" if isnan(found) else f"{found:.2f}"


def rounding(tables: Tables) -> str:
    """Return the exponents of growth by arithmetic and quantity, and how many agree with Brouwer's law."""
    header = ("sums", "errors of", "exponent of Brouwer's law", "least", "median", "largest", "in agreement")
    lines = []
    for source, arithmetic in SOURCES.items():
        for quantity, errors in QUANTITIES.items():
            both = source, quantity
            rows = [row for row in tables["stability_rounding"] if (row["source"], row["quantity"]) == both]
            ends = (f"{one([row['exponent'] for row in rows]):.2f}" for one in (min, np.median, max))
            count = f"{sum(map(agrees, rows))} of {len(rows)}"
            lines.append((arithmetic, errors, f"{rows[0]['brouwer']:g}", *ends, count))
    return table(header, lines, left=2)


def agrees(row: Row) -> bool:
    """Return True if the 95 % interval of an exponent holds that of Brouwer's law."""
    return bool(abs(row["exponent"] - row["brouwer"]) <= row["interval_95"])


def kinetic(tables: Tables) -> str:
    """Return Ruth's error over that of each method on the relativistic oscillator, at a small amplitude and at 1."""
    amplitudes = ("0.01", "0.1", "1")
    lines = []
    for row in tables["kinetic_energy"]:
        if row["roles"] == "own" and row["integrator"] != YARDSTICK:
            ratios = (short(1 / row[f"error / Ruth's at A = {a}"], 2) for a in amplitudes)
            lines.append((label(row["integrator"]), *ratios))
    return table(("method", *(f"amplitude {a}" for a in amplitudes)), lines)


#: Marks of the page, and what stands between them.
PARTS = {"limits": limits, "rounding": rounding, "kinetic": kinetic}


def page(page: str, tables: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page: ``tables`` are those of its parts."""
    rows = tables_of(tables, "")
    return {"page": filled_page(page, {mark: made(rows) for mark, made in PARTS.items()})}
