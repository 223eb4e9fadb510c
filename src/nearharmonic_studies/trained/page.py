"""Tables of docs/results/trained.md and docs/results/training.md: views of tables of the results, proved properties."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from math import isnan, pi
from typing import Any

from nearharmonic.integrators import integrators as registered
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.table import pipes
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.theory.oscillator import shifted_kicks, stability_limit
from nearharmonic_paper.pages.filling import MINUS, Row, fills, label, rows_of, signed, table, tables_of
from nearharmonic_studies.trained.purposes import PURPOSES

#: The ensemble whose best methods are named, the beginning of the name of orbits, and the ensembles of windows.
WIDEST, ORBITS = "d = 2, 0.01 to 0.5", "Kepler"
WINDOWS = (WIDEST, "d = 3, 0.01 to 0.5", "d = 2, 0.001 to 0.01", "Hénon-Heiles", ORBITS)
IDEAS = {
    "exact_oscillator": "oscillator solved exactly", "trained_exact": "oscillator solved exactly (trained)",
    "harmonic_conditions": "harmonic conditions",
    "nystrom": "Nyström", "trained": "trained", "general": "general",
}  # fmt: skip
#: Methods of the table of shifted kicks beside the trained ones: those of the paper, and where such pairs are as plain.
SHIFTED = ("aba104", "abas5o6h", "babs6o5h", "babps6o5h", "babps8o7h", "mclachlan_sb3a4")


@fills
def page(tables: Sequence[str]) -> dict[str, str]:
    """Gains, windows and losses of trained methods, ideas by anharmonicity, long runs, and times."""
    found = tables_of(tables, "trained_")
    every = found["gains"]
    of_orbits, others = ([row for row in every if row["ensemble"].startswith(ORBITS) is yes] for yes in (True, False))
    by_time = [
        (signed(row["gain_lanes"]), signed(row["gain_single"]))
        for row in found["times"]
        if row["ensemble"].startswith(ORBITS)
    ]
    widest = [row for row in every if row["ensemble"] == WIDEST]
    best = ("best published", "log₁₀ error", "best trained", "log₁₀ error", "gain")
    return {
        "gains": gains(others),
        "widest": table(("τ/s", *best), ((f"{row['tau_per_stage']:g}", *best_of(row)) for row in widest)),
        "orbits": table(
            ("evaluations an orbit", *best, "by time, lanes", "by time, single"),
            (
                (f"{2 * pi / row['tau_per_stage']:.0f}", *best_of(row), *both)
                for row, both in zip(of_orbits, by_time, strict=True)
            ),
        ),
        "losses": table(("ensemble", "τ/s", "ahead is", "by up to"), [*losses(every)] or [("none", "", "", "")]),
        "windows": table(
            ("method", *(name if name != ORBITS else "Kepler orbits" for name in WINDOWS), "ensembles with a window"),
            (windows(method, rows) for method, rows in grouped(found["methods"], "method")),
        ),
        "ideas": table(
            ("τ/s", "all ideas, up to δ", "with T and V, up to δ"),
            (
                (f"{tau:g}", *(leaders(rows, key) for key in ("ahead", "ahead with T + V")))
                for tau, rows in grouped(found["ideas"], "tau_per_stage")
            ),
            left=3,
        ),
        "exact": exact(found["ideas"]),
        "long": table(
            ("system", "method", "Σ\\|c\\|", "largest error", "trend", "± (95 %)", "way back", "rounding",
             "over the first"),
            (
                (row["system"], label(row["method"]), *(format(row[key], form) for key, form in LONG.items()))
                for row in found["long"]
            ),
            left=2,
        ),
        "times": times(found["times"]),
    }  # fmt: skip


#: Columns of the table of long runs, and their formats.
LONG = {
    "sum of coefficients": ".1f", "max_energy_error": ".1e", "trend": ".0e", "trend_half_width": ".0e",
    "return_compensated": ".0e", "rounding_plain": ".0e", "rounding_ratio": ".1f",
}  # fmt: skip


def grouped(rows: Iterable[Row], key: str | Callable[[Row], object]) -> Iterator[tuple[Any, list[Row]]]:
    """Neighbouring rows that are equal in a column, or in what a function finds of them."""
    for value, group in groupby(rows, key if callable(key) else lambda row: row[key]):
        yield value, list(group)


def gain_cell(row: Row) -> str:
    """A gain: bold where trained methods are ahead, in brackets where its interval holds 0."""
    text = signed(row["gain"])
    return {"ahead": f"**{text}**", "even": f"({text})"}.get(row["verdict"], text)


def best_of(row: Row) -> tuple[str, ...]:
    """The best published and trained methods with their errors, and the gain with its interval."""
    names = ((label(row[f"best {kind}"]), signed(row[error])) for kind, error in
             {"published": "log10_error", "trained": "log10_error_trained"}.items())  # fmt: skip
    return (*sum(names, ()), f"{gain_cell(row)} ({signed(row['gain_low'])} to {signed(row['gain_high'])})")


def gains(rows: Sequence[Row]) -> str:
    """Gains on each ensemble at each step size, and their mean over the ensembles."""
    cells = {(row["ensemble"], row["tau_per_stage"]): row for row in rows}
    ensembles, taus = list(dict.fromkeys(name for name, _ in cells)), sorted({tau for _, tau in cells})
    lines = [(name, *(gain_cell(cells[name, tau]) for tau in taus)) for name in ensembles]
    means = (sum(cells[name, tau]["gain"] for name in ensembles) / len(ensembles) for tau in taus)
    return table(("ensemble", *(f"{tau:g}" for tau in taus)), [*lines, ("mean", *map(signed, means))])


def losses(rows: Iterable[Row]) -> Iterator[tuple[str, ...]]:
    """Step sizes at which a published method is ahead, neighbours in one row."""
    for (ensemble, behind), inside in grouped(rows, lambda row: (row["ensemble"], row["verdict"] == "behind")):
        if behind:
            most, taus = min(inside, key=lambda row: row["gain"]), sorted({row["tau_per_stage"] for row in inside})
            ends = " to ".join(f"{tau:.3g}" for tau in dict.fromkeys((taus[0], taus[-1])))
            yield ensemble, ends, label(most["best published"]), signed(-most["gain"])


def windows(method: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Windows in which a trained method errs less than all published ones, on some ensembles."""
    found = [next((row for row in rows if row["ensemble"].startswith(name)), None) for name in WINDOWS]
    cells = (
        "nowhere" if row is None or isnan(row["ahead_from"])
        else f"{row['ahead_from']:.3g} to {row['ahead_to']:.3g}, {signed(row['largest_gain'])}"
        for row in found
    )  # fmt: skip
    count = sum(not isnan(row["ahead_from"]) for row in rows)
    return f"`{method}`", *cells, f"{count} of {len(rows)}"


def leaders(rows: Sequence[Row], key: str) -> str:
    """Ideas that lead from the smallest anharmonicity to the largest, each with the one at which it ends."""
    return ", ".join(f"{IDEAS[idea]} {some[-1]['anharmonicity']:.2g}" for idea, some in grouped(rows, key))


def exact(rows: Iterable[Row]) -> str:
    """Gains of trained over other methods with the oscillator solved exactly, by anharmonicity and step size.

    A gain is bold where its interval is above 0, in brackets where it holds 0.
    """
    cells = {}
    for row in rows:
        text, low, high = signed(row["exact_gain"]), row["exact_gain_low"], row["exact_gain_high"]
        cells[row["anharmonicity"], row["tau_per_stage"]] = (
            f"**{text}**" if low > 0 else f"({text})" if high > 0 else text
        )
    deltas, taus = (sorted({place[i] for place in cells}) for i in (0, 1))
    lines = [(f"{delta:.2g}", *(cells[delta, tau] for tau in taus)) for delta in deltas]
    return table(("δ", *(f"{tau:g}" for tau in taus)), lines)


def times(rows: Iterable[Row]) -> str:
    """Times and charges of each system, and the largest change of a gain by them."""
    cells: dict[str, list[str]] = {}
    changes: dict[str, list[float]] = {}
    for row in rows:
        name = re.sub(r"^(d = \d), .*", r"random potentials, \1", row["ensemble"])
        changes.setdefault(name, []).extend(abs(row[f"gain_{mode}"] - row["gain"]) for mode in ("lanes", "single"))
        cells[name] = [f"{row[key]:.2g}" for key in ("ns_lanes", "ns_single", "charge_lanes", "charge_single")]
    header = ("system", "ns, lanes", "ns, single", "charge, lanes", "charge, single", "change of a gain")
    return table(header, ((name, *cells[name], signed(max(changes[name])).lstrip("+")) for name in cells))


@fills
def training(**landscapes: str) -> dict[str, str]:
    """Registered trained methods, methods with shifted kicks, and what searches saw: a path of a table by purpose."""
    trained = [registered[name] for name in registered.registered if name.startswith("trained_")]
    trained.sort(key=lambda one: one.modified)
    numbers = ("stages", "searches", "methods tried", "ended at the best", "best from")
    searched = [
        (
            PURPOSES[name].what, row["composition"] + (f", squares {row['squares']}" if row["squares"] else ""),
            *(row[key] for key in numbers), *(f"{row[key]:.2f}" for key in ("least gain", "mean gain")),
        )
        for name in PURPOSES if name in landscapes for row in rows_of(landscapes[name])
    ]  # fmt: skip
    kicks = ((one, shifted_kicks(one)) for one in (*map(registered.__getitem__, SHIFTED), *trained) if not one.modified)
    return {
        "methods": table(
            ("method", "for", "τ/s", "composition", "stages", "order", "for quadratic T", "harmonic", "stable up to τ",
             "Σ abs"),
            map(properties, trained), left=4,
        ),
        "shifted": table(
            ("method", "a", "d", "b", "a + b", "m"),
            (
                (one.label, *(f"{x:.4f}".replace("-", MINUS) for x in (pair.before, pair.drift, pair.behind, pair.net)),
                 f"{pair.square:.5f}")
                for one, (pair, *_) in filter(lambda both: both[1], kicks)
            ),
        ),
        "landscape": "\n".join(
            pipes(
                ("for", "composition", *numbers[:3], "at the best", "best from", "gain, least", "mean"),
                ([str(cell).replace("-", MINUS) for cell in row] for row in searched), align="llrrrrlr",
            )
        ),
    }  # fmt: skip


def properties(one: Tableau) -> Sequence[object]:
    """Purpose of a trained method, its proved properties, and the sum of its coefficients."""
    purpose = PURPOSES[one.name.removeprefix("trained_")]
    low, high = purpose.window
    total = sum(abs(float(c)) for c in (*one.kick, *one.drift))
    proved: tuple[object, ...] = ("", order_of(one), "", "")
    if not one.modified:
        proved = order_of(one), nystrom_order_of(one), harmonic_order(one), f"{float(stability_limit(one)):.3f}"
    composition = {"kick": "BAB", "drift": "ABA"}[one.first]
    return f"`{one.name}`", purpose.what, f"{low:.3g} to {high:.3g}", composition, one.stages, *proved, f"{total:.2f}"
