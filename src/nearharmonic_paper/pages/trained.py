"""The tables of docs/results/trained.md: views of tables of the results."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from math import isnan, nan, pi
from pathlib import Path
from typing import Any

from nearharmonic.integrators import integrators as registered
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.output.table import Cell

#: Rows of a table of the results, by column, and tables by the last part of their names.
Row = Mapping[str, Any]
Tables = Mapping[str, Sequence[Row]]

#: The ensemble whose best methods are named, those of the table of windows, and the beginning of the name of orbits.
WIDEST, ORBITS = "d = 2, 0.01 to 0.5", "Kepler"
WINDOWS = (WIDEST, "d = 3, 0.01 to 0.5", "d = 2, 0.001 to 0.01", "Hénon-Heiles", ORBITS)
IDEAS = {
    "exact_oscillator": "oscillator solved exactly", "trained_exact": "oscillator solved exactly (trained)",
    "harmonic_conditions": "harmonic conditions",
    "nystrom": "Nyström", "trained": "trained", "general": "general",
}  # fmt: skip


def rows_of(path: str) -> list[Row]:
    """Return the rows of a table, numbers as floats."""
    with Path(path).open(encoding="utf-8", newline="") as file:
        return [{key: number(cell) for key, cell in row.items()} for row in csv.DictReader(file)]


def tables_of(paths: Iterable[str], beginning: str) -> dict[str, list[Row]]:
    """Return the rows of tables by their names without the common beginning."""
    return {Path(path).stem.removeprefix(beginning): rows_of(path) for path in paths}


def number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def label(name: str) -> str:
    """A method as the page calls it: trained ones by the name under which they are registered."""
    return registered[name].label if name in registered and not name.startswith("trained_") else name


def table(header: Sequence[str], rows: Iterable[Sequence[Cell]], left: int = 1) -> str:
    """A Markdown table whose first columns are aligned to the left."""
    return "\n".join(pipes(header, rows, align="l" * left + "r"))


def signed(x: float, digits: int = 2) -> str:
    return "" if isnan(x) else f"{x:+.{digits}f}".replace("-", "\N{MINUS SIGN}")


def gain_cell(row: Row) -> str:
    """A gain: bold where trained methods are ahead, in brackets where its interval holds 0."""
    text = signed(row["gain"])
    return {"ahead": f"**{text}**", "even": f"({text})"}.get(row["verdict"], text)


def interval(row: Row) -> str:
    return f"{gain_cell(row)} ({signed(row['gain_low'])} to {signed(row['gain_high'])})"


def gains(tables: Tables) -> str:
    """Gains on each ensemble at each step size, and their mean over the ensembles."""
    rows = [row for row in tables["gains"] if not row["ensemble"].startswith(ORBITS)]
    taus = sorted({row["tau_per_stage"] for row in rows})
    lines = []
    means: dict[float, list[float]] = {tau: [] for tau in taus}
    for ensemble, group in groupby(rows, key=lambda row: row["ensemble"]):
        cells = {row["tau_per_stage"]: row for row in group}
        lines.append((ensemble, *(gain_cell(cells[tau]) for tau in taus)))
        for tau in taus:
            means[tau].append(cells[tau]["gain"])
    lines.append(("mean", *(signed(sum(means[tau]) / len(means[tau])) for tau in taus)))
    return table(("ensemble", *(f"{tau:g}" for tau in taus)), lines)


def best(
    rows: Iterable[Row], first: str, shown: Callable[[float], str]
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The best published and trained methods of one ensemble with their errors: a header, and a line for each row."""
    header = (first, "best published", "log₁₀ error", "best trained", "log₁₀ error", "gain")
    return header, [
        (
            shown(row["tau_per_stage"]), label(row["best published"]), signed(row["log10_error"]),
            label(row["best trained"]), signed(row["log10_error_trained"]), interval(row),
        )
        for row in rows
    ]  # fmt: skip


def widest(tables: Tables) -> str:
    inside = [row for row in tables["gains"] if row["ensemble"] == WIDEST]
    return table(*best(inside, "τ/s", lambda tau: f"{tau:g}"))


def orbits(tables: Tables) -> str:
    """As above for Kepler orbits, by evaluations of the force in an orbit, and gains at equal time."""
    inside, timed = ([row for row in tables[name] if row["ensemble"].startswith(ORBITS)] for name in ("gains", "times"))
    header, lines = best(inside, "evaluations an orbit", lambda tau: f"{2 * pi / tau:.0f}")
    by_time = [(signed(row["gain_lanes"]), signed(row["gain_single"])) for row in timed]
    lines = [(*line, *gained) for line, gained in zip(lines, by_time, strict=True)]
    return table((*header, "by time, lanes", "by time, single"), lines)


def losses(tables: Tables) -> str:
    """List the step sizes at which a published method is ahead, neighbours in one row."""
    lines = []
    rows = tables["gains"]
    for (ensemble, behind), group in groupby(rows, key=lambda row: (row["ensemble"], row["verdict"] == "behind")):
        if behind:
            inside = list(group)
            most = min(inside, key=lambda row: row["gain"])
            taus = sorted({row["tau_per_stage"] for row in inside})
            ends = " to ".join(f"{tau:.3g}" for tau in dict.fromkeys((taus[0], taus[-1])))
            lines.append((ensemble, ends, label(most["best published"]), signed(-most["gain"])))
    return table(("ensemble", "τ/s", "ahead is", "by up to"), lines or [("none", "", "", "")])


def windows(tables: Tables) -> str:
    """List the windows in which each trained method errs less than all published ones, on some ensembles."""
    rows = tables["methods"]
    lines = []
    for method, group in groupby(rows, key=lambda row: row["method"]):
        cells = {row["ensemble"]: row for row in group}
        found = [next((r for name, r in cells.items() if name.startswith(one)), None) for one in WINDOWS]
        count = sum(not isnan(row["ahead_from"] or nan) for row in cells.values() if row["ensemble"])
        lines.append((f"`{method}`", *(window(row) for row in found), f"{count} of {len(cells)}"))
    header = ("method", *(name if name != ORBITS else "Kepler orbits" for name in WINDOWS), "ensembles with a window")
    return table(header, lines)


def window(row: Row | None) -> str:
    if row is None or isnan(row["ahead_from"]):
        return "nowhere"
    return f"{row['ahead_from']:.3g} to {row['ahead_to']:.3g}, {signed(row['largest_gain'])}"


def ideas(tables: Tables) -> str:
    """Who is ahead from the smallest anharmonicity to the largest, among all ideas and among those with T and V."""
    lines = []
    for tau, group in groupby(tables["ideas"], key=lambda row: row["tau_per_stage"]):
        inside = list(group)
        lines.append((f"{tau:g}", *(sequence(inside, key) for key in ("ahead", "ahead with T + V"))))
    return table(("τ/s", "all ideas, up to δ", "with T and V, up to δ"), lines, left=3)


def exact(tables: Tables) -> str:
    """Gains of trained over other methods with the oscillator solved exactly, by anharmonicity and step size."""
    rows = tables["ideas"]
    taus, deltas = (sorted({row[key] for row in rows}) for key in ("tau_per_stage", "anharmonicity"))
    cells = {(row["tau_per_stage"], row["anharmonicity"]): exact_cell(row) for row in rows}
    lines = [(f"{delta:.2g}", *(cells[tau, delta] for tau in taus)) for delta in deltas]
    return table(("δ", *(f"{tau:g}" for tau in taus)), lines)


def exact_cell(row: Row) -> str:
    """A gain: bold where its interval is above 0, in brackets where it holds 0."""
    text, low, high = signed(row["exact_gain"]), row["exact_gain_low"], row["exact_gain_high"]
    return f"**{text}**" if low > 0 else f"({text})" if high > 0 else text


def sequence(rows: Sequence[Row], key: str) -> str:
    """Runs of equal leaders, each with the anharmonicity at which it ends."""
    runs = [(leader, list(group)[-1]["anharmonicity"]) for leader, group in groupby(rows, key=lambda row: row[key])]
    return ", ".join(f"{IDEAS[leader]} {end:.2g}" for leader, end in runs)


def long_runs(tables: Tables) -> str:
    header = (
        "system",
        "method",
        "Σ\\|c\\|",
        "largest error",
        "trend",
        "± (95 %)",
        "way back",
        "rounding",
        "over the first",
    )
    lines = [
        (
            row["system"], label(row["method"]), f"{row['sum of coefficients']:.1f}", f"{row['max_energy_error']:.1e}",
            f"{row['trend']:.0e}", f"{row['trend_half_width']:.0e}", f"{row['return_compensated']:.0e}",
            f"{row['rounding_plain']:.0e}", f"{row['rounding_ratio']:.1f}",
        )
        for row in tables["long"]
    ]  # fmt: skip
    return table(header, lines, left=2)


def times(tables: Tables) -> str:
    """Times and charges of each system, and the largest change of a gain by them."""
    lines: dict[str, tuple[list[str], float]] = {}
    for ensemble, group in groupby(tables["times"], key=lambda row: row["ensemble"]):
        inside = list(group)
        row = inside[0]
        change = max((abs(r[f"gain_{m}"] - r["gain"]) for r in inside for m in ("lanes", "single")), default=nan)
        cells = [f"{row[key]:.2g}" for key in ("ns_lanes", "ns_single", "charge_lanes", "charge_single")]
        name = re.sub(r"^(d = \d), .*", r"random potentials, \1", ensemble)
        _, before = lines.get(name, ([], change))
        lines[name] = cells, max(change, before)
    shown = [(name, *cells, "" if isnan(change) else f"{change:.2f}") for name, (cells, change) in lines.items()]
    return table(("system", "ns, lanes", "ns, single", "charge, lanes", "charge, single", "change of a gain"), shown)


#: Marks of the page, and what stands between them.
PARTS = {
    "gains": gains, "widest": widest, "orbits": orbits, "losses": losses, "windows": windows, "ideas": ideas,
    "exact": exact,
    "long": long_runs, "times": times,
}  # fmt: skip


def parts(tables: Tables) -> dict[str, str]:
    """Return the tables of the page by their marks."""
    return {name: made(tables) for name, made in PARTS.items()}


def page(page: str, tables: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page: ``tables`` are trained_*.csv."""
    return {"page": filled_page(page, parts(tables_of(tables, "trained_")))}
