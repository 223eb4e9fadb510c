"""Pages on targets of the workflow: their tables are views of cubes and tables of the results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import hypot, inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.integrators import integrators as registered
from nearharmonic.output.store import read
from nearharmonic.output.table import Table, short
from nearharmonic.recommendation.measure import TARGETS, crossing, of_kind
from nearharmonic.systems import systems as known
from nearharmonic_paper.experiments.exact_oscillator.reductions import BEST, crossing_table
from nearharmonic_paper.experiments.stability.reductions import YARDSTICK
from nearharmonic_paper.experiments.work_precision.figures import CURVES
from nearharmonic_paper.experiments.work_precision.tables import COMPARED_MEASURES, ERRORS, Pair, pairs
from nearharmonic_paper.pages.filling import (
    MINUS,
    Row,
    digits,
    fills,
    label,
    power,
    shown,
    signed,
    table,
    tables_of,
)
from nearharmonic_paper.tasks.provenance import measures_time

if TYPE_CHECKING:
    import xarray as xr

#: The implicit method, and the errors at which times beside it are compared.
IMPLICIT, IMPLICIT_ERRORS = "gauss16", (1e-6, 1e-9, 1e-12, 1e-14)
#: Modes of timed calls by their names in tables, and the systems of docs/results/timings.md.
MODES = {"trajectory": "one trajectory", "lanes": "each of an ensemble"}
TIMED = ("sho", "henon_heiles", "kepler")
#: Isolated sets of the paper with five stages, and decimals by which they are recognised.
ISOLATED, DECIMALS = ("abas5o6h", "abas5o6h_b", "abas5o6h_c"), 8


@fills
def stability(tables: Sequence[str]) -> dict[str, str]:
    """Step sizes up to which orbits stay, exponents of round-off, and errors with another T."""
    found = tables_of(tables)
    limits, kinetic = found["stability_henon_heiles"], found["kinetic_energy"]
    energies = list(dict.fromkeys(row["energy"] for row in limits))
    share = {(row["integrator"], row["energy"]): row["share_of_linear_limit"] for row in limits}
    linear = {row["integrator"]: row["linear_limit_tau_per_stage"] for row in limits}
    amplitudes = ("0.01", "0.1", "1")
    return {
        "limits": table(
            ("method", "linear limit, τ/s", *(f"H = {Fraction(H).limit_denominator(1000)}" for H in energies)),
            [
                (label(name), f"{limit:.3g}", *(shown(share[name, H], ".2f", "none") for H in energies))
                for name, limit in linear.items()
            ],
        ),
        "rounding": rounding(found["stability_rounding"]),
        "kinetic": table(
            ("method", *(f"amplitude {a}" for a in amplitudes)),
            [
                (label(row["integrator"]), *(short(1 / row[f"error / Ruth's at A = {a}"], 2) for a in amplitudes))
                for row in kinetic
                if row["roles"] == "own" and row["integrator"] != YARDSTICK
            ],
        ),
    }


def rounding(rows: Sequence[Row]) -> str:
    """Exponents of growth by arithmetic and quantity, and how many intervals hold the exponent of Brouwer's law."""
    sums = {"plain": "plain", "compensated": "compensated", "extended": "double-double"}
    lines = []
    for (source, words), (quantity, what) in product(sums.items(), {"energy_error": "energy", "lag": "phase"}.items()):
        some = [row for row in rows if (row["source"], row["quantity"]) == (source, quantity)]
        exponents = [row["exponent"] for row in some]
        agree = sum(abs(row["exponent"] - row["brouwer"]) <= row["interval_95"] for row in some)
        ends = [f"{end(exponents):.2f}" for end in (min, np.median, max)]
        lines.append((words, what, f"{some[0]['brouwer']:g}", *ends, f"{agree} of {len(some)}"))
    header = ("sums", "errors of", "exponent of Brouwer's law", "least", "median", "largest", "in agreement")
    return table(header, lines, left=2)


@fills
def derivation(tables: Sequence[str]) -> dict[str, str]:
    """Numbers of solutions, the isolated solutions, families, and what the paper's own route finds."""
    found = tables_of(tables, "derived_")
    errors = {row["solution"]: row for row in found["errors"] if row["tau/s"] == 0.05}
    five = [row for row in found["solutions"] if row["stages"] == 5]
    names = {f"solution {row['solution']:g}": isolated(row) for row in five}
    routes = [row for row in found["routes"] if row["route"].startswith("adaptive simplex")]
    reached = [row["reached"] for row in routes if row["reached"].startswith("solution")]
    starts = {row["start"].removeprefix("random, one of ").replace(" in ", " of ") for row in routes}
    solved = sorted({names[one] or "one without a name" for one in reached})
    columns = ("stages", "harmonic order", "complex solutions", "real solutions")
    return {
        "counts": table(
            columns,
            [[f"{row[key]:g}" for key in (*columns[:3], "real solutions by Sturm")] for row in found["counts"]],
            left=0,
        ),
        "solutions": table(
            ("outer row", "inner row", "in the paper", "error"),
            [
                (
                    *(independent(row[f"half of the {part} row"]) for part in ("outer", "inner")),
                    isolated(row),
                    short(errors[row["solution"]]["max error, harmonic oscillator"], 2),
                )
                for row in five
            ],
            left=3,
        ),
        "families": table(
            ("set", "free parameters", "members found", "smaller sum", "smaller next error"),
            [
                (
                    row["set"],
                    *(f"{row[key]:g}" for key in ("free parameters", "members found")),
                    *(f"{100 * row[f'members with a smaller {what}']:.2g} %" for what in ("sum", "next kappa")),
                )
                for row in found["families"]
            ],
        ),
        "route": f"A short run selects {' and '.join(sorted(starts))} starts. Of these {len(reached)} reach 10⁻¹²⁸. "
        f"They find {len(solved)} of the {len(names)} solutions: {', '.join(solved)}.",
    }


def independent(half: str) -> str:
    """The independent coefficients of half of a row: the middle ones of the odd row follow from the sum."""
    return ", ".join(f"{float(c):.4f}".replace("-", MINUS) for c in half.split()[:2])


def isolated(row: Row) -> str:
    """The name that the paper gives to a solution; empty if it has none."""
    halves = {row["half of the outer row"], row["half of the inner row"]}
    for one in map(registered.__getitem__, ISOLATED):
        rows = (one.drift, one.kick)
        if {" ".join(f"{float(c):.{DECIMALS}f}" for c in half[: (len(half) + 1) // 2]) for half in rows} == halves:
            return one.label
    return ""


@fills
def exact_oscillator(cube: str) -> dict[str, str]:
    """Leads of methods that solve the oscillator exactly, and the amplitudes up to which each is ahead."""
    found = read(cube)
    medians = found.sel(quantile=0.5, charge=1.0)
    ratio = medians.energy_error.min("integrator") / medians.exact_energy_error.min("exact_integrator")
    decades = np.log10(ratio).isel(energy=[0, -1])
    crossings = {
        (row["exact oscillator"], row["tau_per_stage"], row["charge"]): row
        for row in crossing_table(found).records()
        if row["T + V"] == BEST
    }
    taus, charges = found.tau_per_stage.values.tolist(), found.charge.values.tolist()[:2]
    return {
        "leads": table(
            ("τ/s", *(f"H = {Fraction(H).limit_denominator(10**6)}" for H in decades.energy.values.tolist())),
            [(f"{tau:g}", *(signed(x, 1) for x in decades.sel(tau_per_stage=tau).values.tolist())) for tau in taus],
        ),
        "crossings": table(
            ("method", "τ/s", *(f"charge {charge:g}" for charge in charges)),
            [
                (name, f"{tau:g}", *(amplitude(crossings[name, tau, charge]) for charge in charges))
                for name, tau in product(found.exact_label.values.tolist(), taus)
            ],
            left=4,
        ),
    }


def amplitude(row: Row) -> str:
    """An amplitude and its interval."""
    at, low, high = (row[f"amplitude{end}"] for end in ("", "_low", "_high"))
    return {0: "nowhere", inf: "everywhere"}.get(at, f"{at:.3g} ({low:.3g} to {high:.3g})")


@measures_time
@fills
def timings(cube: str) -> dict[str, str]:
    """Times beside other libraries; the log names machine and libraries."""
    measured, facts = pairs(cube, TIMED)
    print(f"Machine: {facts['cpu']}; {facts['libraries']}")
    runs = [(f"{pair.label}, {words}", pair, mode) for mode, words in MODES.items() for pair in measured]
    times = []
    for pair in measured:
        each = [of_mode([*pair.own, *pair.others], mode) for mode in MODES]
        times.append("\n\n".join([f"### {pair.label}, t = {pair.t_end}", *each]))
    return {
        "ratios": table(
            ("system", *map(power, ERRORS)),
            [
                (head, *(digits_bold(pair.fastest(error, mode)[0][1].time / pair.standard(error, mode), above=1)
                         for error in ERRORS))
                for head, pair, mode in runs
            ],
        ),
        "implicit": table(
            ("system", *map(power, IMPLICIT_ERRORS)),
            [(head, *(beside_implicit(pair, error, mode) for error in IMPLICIT_ERRORS)) for head, pair, mode in runs],
        ),
        "times": "\n\n".join(times),
    }  # fmt: skip


def digits_bold(ratio: float, above: float = inf, below: float = -inf) -> str:
    """A ratio with two digits, bold beyond a bound."""
    return f"**{digits(ratio)}**" if ratio > above or ratio < below else digits(ratio)


def beside_implicit(pair: Pair, error: float, mode: str) -> str:
    """Time of the implicit method over the fastest splitting's, bold below one, and over heyoka's in brackets."""
    times = {one["solver"].item(): crossing(one, pair.measure, error, mode).time for one in pair.own}
    own = times.pop(IMPLICIT, nan)
    return f"{digits_bold(own / least(times.values()), below=1)} ({digits(own / pair.standard(error, mode))})"


def least(times: Any) -> float:
    """The least of times that are known, NaN without any."""
    return min(filter(isfinite, times), default=nan)


def of_mode(curves: Sequence[xr.Dataset], mode: str) -> str:
    """Milliseconds to errors and ratios to the least of a column, which is bold.

    Rows are other libraries, and at each error the fastest of the paper's methods and of those beyond it.
    """
    times = {
        one["solver"].item(): [1e3 * crossing(one, "max", error, mode).time for error in TARGETS] for one in curves
    }
    times = {method: row for method, row in times.items() if any(map(isfinite, row))}
    best = [least(column) for column in zip(*times.values(), strict=True)]
    own = [name for curve in of_kind(curves, "splitting") if (name := curve["solver"].item()) in times]
    groups = [[name for name in own if (name in BENCHMARKED) == paper] for paper in (True, False)]
    fastest = {
        min(group, key=lambda name: times[name][i] if isfinite(times[name][i]) else inf)
        for group in groups if group for i in range(len(TARGETS))
    }  # fmt: skip
    shown = fastest | {curve["solver"].item() for curve in of_kind(curves, "peer")}
    rows = [
        (curve["label"].item(), *map(beside_least, times[method], best))
        for curve in curves
        if (method := curve["solver"].item()) in times and method in shown
    ]
    return table((MODES[mode], *map(power, TARGETS)), rows)


def beside_least(time: float, best: float) -> str:
    """A time, and its ratio to the least; the least is bold."""
    if time == best:
        return f"**{digits(time)}**"
    return f"{digits(time)} ({digits(time / best)})" if isfinite(time) else "not reached"


@measures_time
@fills
def regularised(cube: str, names: Sequence[str]) -> dict[str, Any]:
    """Times on regularised and original equations of Kepler orbits, as a page and as the file of its figure."""
    rows: list[Sequence[Any]] = []
    for measure in COMPARED_MEASURES:
        measured, facts = pairs(cube, names, measure=measure)
        rows += [row for pair in measured if pair.original for row in regularised_rows(pair)]
    print(f"Machine: {facts['cpu']}; {facts['libraries']}")
    times = Table(header=("e", "t_end", "measure", "curve", "error", "ms", "ratio"), rows=rows)
    return {"times": regularised_tables(times.records()), "file": times.csv().encode()}


def regularised_rows(pair: Pair) -> Iterator[Sequence[Any]]:
    """Rows of the file: times of each curve of the figure that was measured, and their ratios to heyoka's."""
    groups: dict[str, Sequence[xr.Dataset]] = {"own": pair.own, "own_original": pair.own_original}
    groups |= {curve["solver"].item(): [curve] for curve in (*pair.own, *pair.others)}
    q, p = known[pair.system].start(float)
    GM = known[pair.system].constants(float)[0]
    eccentricity = abs(hypot(*q) * hypot(*p) ** 2 / GM - 1)  # of an orbit that begins at one of its apsides
    for key, error in product([key for key in CURVES if key in groups], ERRORS):
        time = least(crossing(curve, pair.measure, error, "trajectory").time for curve in groups[key])
        ratio = time / pair.standard(error, "trajectory")
        yield f"{eccentricity:.3g}", pair.t_end, pair.measure, key, error, 1e3 * time, ratio


def regularised_tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table for each kind of error and orbit: milliseconds, and ratios in brackets."""
    cells: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in rows:
        ratio = f" ({digits(row['ratio'])})" if isfinite(row["ratio"]) else ""
        cell = f"{digits(row['ms'])}{ratio}" if isfinite(row["ms"]) else "not reached"
        cells.setdefault((row["measure"], row["e"]), {}).setdefault(row["curve"], []).append(cell)
    return "\n\n".join(
        table(
            (f"e = {e}, {COMPARED_MEASURES[measure]}", *map(power, ERRORS)),
            [(CURVES[key][0], *line) for key, line in lines.items()],
        )
        for (measure, e), lines in cells.items()
    )
