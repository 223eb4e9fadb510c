"""The tables and pictures of docs/trained.md, from results of the target ``trained``.

Run: ``snakemake -j2 trained`` and then ``python benchmarks/trained.py [results/paper]`` (a second). Nothing is computed
here: each table of the page is a view of one of the tables of the results.
"""

from __future__ import annotations

import argparse
import csv
import re
from itertools import groupby
from math import isnan, nan, pi
from pathlib import Path

from PIL import Image

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.output.page import filled, pipes

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/trained.md"
FIGURES = ("trained_error", "trained_gain", "trained_ideas")
#: Colours of a picture on the page.
COLOURS = 128
#: The ensemble whose best methods are named, those of the table of windows, and the beginning of the name of orbits.
WIDEST, ORBITS = "d = 2, 0.01 to 0.5", "Kepler"
WINDOWS = (WIDEST, "d = 3, 0.01 to 0.5", "d = 2, 0.001 to 0.01", "Hénon-Heiles", ORBITS)
IDEAS = {
    "exact_oscillator": "oscillator solved exactly", "harmonic_conditions": "harmonic conditions",
    "nystrom": "Nyström", "trained": "trained", "general": "general",
}  # fmt: skip


def rows_of(folder, name):
    """The rows of a table of the results, numbers as floats."""
    with (folder / f"tables/trained_{name}.csv").open(encoding="utf-8", newline="") as file:
        return [{key: number(cell) for key, cell in row.items()} for row in csv.DictReader(file)]


def number(cell):
    try:
        return float(cell)
    except ValueError:
        return cell


def label(name):
    """A method as the page calls it: trained ones by the name under which they are registered."""
    known = name in nh.integrators or name in nh.modified_integrators
    return integrators[name].label if known and not name.startswith("trained_") else name


def table(header, rows, left=1):
    """A Markdown table whose first columns are aligned to the left."""
    return "\n".join(pipes(header, rows, align="l" * left + "r"))


def signed(x, digits=2):
    return "" if isnan(x) else f"{x:+.{digits}f}".replace("-", "\N{MINUS SIGN}")


def gain_cell(row):
    """A gain: bold where trained methods are ahead, in brackets where its interval holds 0."""
    text = signed(row["gain"])
    return {"ahead": f"**{text}**", "even": f"({text})"}.get(row["verdict"], text)


def interval(row):
    return f"{gain_cell(row)} ({signed(row['gain_low'])} to {signed(row['gain_high'])})"


def gains(folder):
    """Gains on each ensemble at each step size, and their mean over the ensembles."""
    rows = [row for row in rows_of(folder, "gains") if not row["ensemble"].startswith(ORBITS)]
    taus = sorted({row["tau_per_stage"] for row in rows})
    lines, means = [], {tau: [] for tau in taus}
    for ensemble, group in groupby(rows, key=lambda row: row["ensemble"]):
        cells = {row["tau_per_stage"]: row for row in group}
        lines.append((ensemble, *(gain_cell(cells[tau]) for tau in taus)))
        for tau in taus:
            means[tau].append(cells[tau]["gain"])
    lines.append(("mean", *(signed(sum(means[tau]) / len(means[tau])) for tau in taus)))
    return table(("ensemble", *(f"{tau:g}" for tau in taus)), lines)


def best(rows, first, shown):
    """The best published and trained methods of one ensemble with their errors: a header, and a line for each row."""
    header = (first, "best published", "log₁₀ error", "best trained", "log₁₀ error", "gain")
    return header, [
        (
            shown(row["tau_per_stage"]), label(row["best published"]), signed(row["log10_error"]),
            label(row["best trained"]), signed(row["log10_error_trained"]), interval(row),
        )
        for row in rows
    ]  # fmt: skip


def widest(folder):
    inside = [row for row in rows_of(folder, "gains") if row["ensemble"] == WIDEST]
    return table(*best(inside, "τ/s", lambda tau: f"{tau:g}"))


def orbits(folder):
    """As above for Kepler orbits, by evaluations of the force in an orbit, and gains at equal time."""
    inside, timed = (
        [row for row in rows_of(folder, name) if row["ensemble"].startswith(ORBITS)] for name in ("gains", "times")
    )
    header, lines = best(inside, "evaluations an orbit", lambda tau: f"{2 * pi / tau:.0f}")
    by_time = [(signed(row["gain_lanes"]), signed(row["gain_single"])) for row in timed]
    lines = [(*line, *gained) for line, gained in zip(lines, by_time, strict=True)]
    return table((*header, "by time, lanes", "by time, single"), lines)


def losses(folder):
    """Step sizes at which a published method is ahead, neighbours in one row."""
    lines = []
    rows = rows_of(folder, "gains")
    for (ensemble, behind), group in groupby(rows, key=lambda row: (row["ensemble"], row["verdict"] == "behind")):
        if behind:
            inside = list(group)
            most = min(inside, key=lambda row: row["gain"])
            taus = sorted({row["tau_per_stage"] for row in inside})
            ends = " to ".join(f"{tau:.3g}" for tau in dict.fromkeys((taus[0], taus[-1])))
            lines.append((ensemble, ends, label(most["best published"]), signed(-most["gain"])))
    return table(("ensemble", "τ/s", "ahead is", "by up to"), lines or [("none", "", "", "")])


def windows(folder):
    """List the windows in which each trained method errs less than all published ones, on some ensembles."""
    rows = rows_of(folder, "methods")
    lines = []
    for method, group in groupby(rows, key=lambda row: row["method"]):
        cells = {row["ensemble"]: row for row in group}
        found = [next((r for name, r in cells.items() if name.startswith(one)), None) for one in WINDOWS]
        count = sum(not isnan(row["ahead_from"] or nan) for row in cells.values() if row["ensemble"])
        lines.append((f"`{method}`", *(window(row) for row in found), f"{count} of {len(cells)}"))
    header = ("method", *(name if name != ORBITS else "Kepler orbits" for name in WINDOWS), "ensembles with a window")
    return table(header, lines)


def window(row):
    if row is None or isnan(row["ahead_from"]):
        return "nowhere"
    return f"{row['ahead_from']:.3g} to {row['ahead_to']:.3g}, {signed(row['largest_gain'])}"


def ideas(folder):
    """Who is ahead from the smallest anharmonicity to the largest, among all ideas and among those with T and V."""
    lines = []
    for tau, group in groupby(rows_of(folder, "ideas"), key=lambda row: row["tau_per_stage"]):
        inside = list(group)
        lines.append((f"{tau:g}", *(sequence(inside, key) for key in ("ahead", "ahead with T + V"))))
    return table(("τ/s", "all ideas, up to δ", "with T and V, up to δ"), lines, left=3)


def sequence(rows, key):
    """Runs of equal leaders, each with the anharmonicity at which it ends."""
    runs = [(leader, list(group)[-1]["anharmonicity"]) for leader, group in groupby(rows, key=lambda row: row[key])]
    return ", ".join(f"{IDEAS[leader]} {end:.2g}" for leader, end in runs)


def long_runs(folder):
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
        for row in rows_of(folder, "long")
    ]  # fmt: skip
    return table(header, lines, left=2)


def times(folder):
    """Times and charges of each system, and the largest change of a gain by them."""
    lines = []
    for ensemble, group in groupby(rows_of(folder, "times"), key=lambda row: row["ensemble"]):
        inside = list(group)
        row = inside[0]
        change = max((abs(r[f"gain_{m}"] - r["gain"]) for r in inside for m in ("lanes", "single")), default=nan)
        cells = [f"{row[key]:.2g}" for key in ("ns_lanes", "ns_single", "charge_lanes", "charge_single")]
        name = re.sub(r"^(d = \d), .*", r"random potentials, \1", ensemble)
        if lines and lines[-1][0] == name:
            change = max(change, lines.pop()[-1])
        lines.append((name, *cells, change))
    shown = [(*line[:-1], "" if isnan(line[-1]) else f"{line[-1]:.2f}") for line in lines]
    return table(("system", "ns, lanes", "ns, single", "charge, lanes", "charge, single", "change of a gain"), shown)


#: Marks of the page, and what stands between them.
PARTS = {
    "gains": gains, "widest": widest, "orbits": orbits, "losses": losses, "windows": windows, "ideas": ideas,
    "long": long_runs, "times": times,
}  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("results", nargs="?", default=ROOT / "results/paper", type=Path, help="folder of the results")
    folder = parser.parse_args().results
    parts = {name: made(folder) for name, made in PARTS.items()}
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), parts), encoding="utf-8")
    for stem in FIGURES:
        with Image.open(folder / f"figures/{stem}.png") as picture:  # few colours take a fifth of the room
            picture.convert("RGB").quantize(COLOURS).save(PAGE.parent / f"{stem}.png", optimize=True)
    print(f"wrote {PAGE} and {len(FIGURES)} pictures")


if __name__ == "__main__":
    main()
