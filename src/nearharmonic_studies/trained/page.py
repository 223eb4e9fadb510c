"""Figures of the experiment, and tables of docs/results/trained.md and docs/results/training.md."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from math import isnan, pi
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MultipleLocator

from nearharmonic.integrators import integrators as registered
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.table import pipes
from nearharmonic.plotting.profile import text_on
from nearharmonic.plotting.style import house_style, lettered, log_scale, new_figure, panel_letter, style_of
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.theory.oscillator import shifted_kicks, stability_limit
from nearharmonic_paper.pages.filling import MINUS, Row, fills, label, rows_of, signed, table, tables_of
from nearharmonic_studies.trained.settings import ORBITS, PURPOSES

# --- Figures of the comparison: errors of the best methods on each ensemble, and gains of trained ones.

#: Range of the published methods, their best one, and the best trained one.
RANGE, BEST, AHEAD = "#dcdcdc", "#0072b2", "#d55e00"
#: Areas in which trained and in which published methods are ahead.
GAINED, LOST = "#fbe0cf", "#d3e7f3"
#: Colours and markers of the curves of a panel of gains: all readers see the differences.
CURVES = ("#0072b2", "#d55e00", "#000000", "#a03070", "#009e73", "#6b6b6b")
MARKERS = ("o", "s", "^", "D", "v", "P")
COLUMNS, GAIN_COLUMNS = 4, 3
#: Largest displayed error, and labelled step sizes.
HIGHEST, TICKS = 0.02, (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
#: Factor between errors that are labelled.
LABELLED = 1000


@house_style
def trained_error(cube: xr.Dataset) -> Figure:
    """Draw ``mean_log_error`` of ``cube`` against the step size, a panel for each ensemble."""
    count = cube["ensemble"].size
    rows = -(-(count + 2) // COLUMNS)
    height = 0.95 + 2.15 * rows
    drawn = new_figure(9.2, height)
    grid = drawn.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
    drawn.subplots_adjust(left=0.07, right=0.99, top=1 - 0.6 / height, bottom=0.45 / height, wspace=0.24, hspace=0.28)
    for i, axes in enumerate(grid[:count]):
        _errors(axes, cube.isel(ensemble=i))
        axes.set_title(lettered(i, _title(str(cube["ensemble"].values[i]))), loc="left", y=1.0, fontsize=8, pad=4)
        if i % COLUMNS == 0:
            axes.set_ylabel(r"$\max\,|\Delta H/H_0|$", labelpad=2)
        if i + COLUMNS >= count:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(r"$\tau/s$ (rad)", labelpad=1)
    for axes in grid[count:]:
        axes.set_axis_off()
    drawn.text(0.07, 1 - 0.2 / height, f"Mean over the problems of each ensemble{_interval(cube)}", va="center")
    box = grid[count].get_position()
    drawn.legend(
        handles=_legend(cube), loc="upper left", bbox_to_anchor=(box.x0 - 0.01, box.y1), ncols=3, fontsize=8,
        labelspacing=0.5, columnspacing=1.2, borderaxespad=0,
    )  # fmt: skip
    return drawn


def _title(ensemble: str) -> str:
    """Return the name of an ensemble; the numbers of a random potential are its strengths."""
    return ensemble.replace(", ", ", strength ", 1) if ensemble.startswith("d = ") else ensemble


def _interval(cube: xr.Dataset) -> str:
    """Return the interval of the runs, as far as the attributes of the cube tell."""
    try:
        t_end = json.loads(cube.attrs["settings"])["settings"]["t_end"]
    except (KeyError, ValueError):
        return ""
    return rf"; $t$ = {t_end} rad of the fastest small oscillation, {ORBITS} periods of Kepler orbits"


def _errors(axes: Axes, one: xr.Dataset) -> None:
    tau, errors = one["tau_per_stage"].values, 10 ** one["mean_log_error"].values
    published, trained = (errors[one["kind"].values == kind] for kind in ("published", "trained"))
    best, ahead = _least(published), _least(trained)
    if len(published):
        worst = np.where(np.isfinite(published), published, np.inf).max(axis=0)
        axes.fill_between(tau, best, np.clip(worst, None, 1), color=RANGE, linewidth=0, zorder=1)
        axes.plot(tau, best, color=BEST, linewidth=1.6, marker="o", markersize=2.8, zorder=3)
    if len(trained):
        axes.plot(tau, ahead, color=AHEAD, linewidth=1.6, zorder=4)
        for x, y, name in zip(tau, ahead, _leaders(one), strict=True):
            axes.plot([x], [y], **style_of(name).points(markersize=4.6, markeredgewidth=0.6, zorder=5))
    if len(published) and len(trained):
        for colour, inside in ((GAINED, ahead <= best), (LOST, ahead >= best)):
            axes.fill_between(tau, best, ahead, where=inside, interpolate=True, color=colour, linewidth=0, zorder=2)
    finite = errors[np.isfinite(errors)]
    axes.set_ylim((finite.min() if finite.size else 1e-16) / 4, HIGHEST)
    log_scale(axes, "y")
    # Every decade has a tick, every third one a label: more labels would overlap the panel on the left.
    axes.yaxis.set_major_locator(LogLocator(base=LABELLED, numticks=12))
    axes.yaxis.set_minor_locator(LogLocator(base=10, numticks=20))
    step_axis(axes)


def _least(rows: Floats) -> Floats:
    """Return the smallest finite number of each column, NaN where there is none."""
    found: Floats = np.where(np.isfinite(rows), rows, np.inf).min(axis=0, initial=np.inf)
    return np.where(np.isfinite(found), found, np.nan)


def _leaders(one: xr.Dataset) -> list[str]:
    """Return the name of the best trained method at each step size of an ensemble, "" where there is none."""
    trained = one.isel(integrator=np.flatnonzero(one["kind"].values == "trained"))
    names, errors = trained["integrator"].values, trained["mean_log_error"].values
    return [str(names[np.nanargmin(column)]) if np.isfinite(column).any() else "" for column in errors.T]


def step_axis(axes: Axes) -> None:
    """Format the x axis for step sizes: logarithmic, with explicit labels because it has less than two decades."""
    log_scale(axes, "x")
    low, high = axes.get_xlim()
    axes.set_xticks([x for x in TICKS if low <= x <= high] or [low, high])
    axes.xaxis.set_major_formatter("{x:g}")


def _legend(cube: xr.Dataset) -> list[Line2D | Patch]:
    """Return entries for the areas and lines, and for each trained method that is the best one somewhere."""
    handles: list[Line2D | Patch] = [
        Patch(color=RANGE, label="all published methods"),
        Patch(color=GAINED, label="trained ahead"),
        Patch(color=LOST, label="published ahead"),
        Line2D([], [], color=BEST, linewidth=1.6, marker="o", markersize=3, label="best published"),
        Line2D([], [], color=AHEAD, linewidth=1.6, label="best trained:"),
    ]
    leaders = {name for i in range(cube["ensemble"].size) for name in _leaders(cube.isel(ensemble=i))}
    for name, text in zip(cube["integrator"].values, cube["label"].values, strict=True):
        if str(name) in leaders:
            look = style_of(str(name)).points(markersize=4.8, markeredgewidth=0.6)
            handles.append(Line2D([], [], label=str(text), **look))
    return handles


@house_style
def trained_gain(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` and ``gain_interval`` of ``cube`` against the step size, ensembles of a kind in one panel."""
    panels = list(dict.fromkeys(map(str, cube["panel"].values)))
    columns = min(GAIN_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    width, height = 0.62 + 2.86 * columns, 0.5 + 3.15 * rows
    drawn = new_figure(width, height)
    grid = drawn.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    drawn.subplots_adjust(
        left=0.56 / width, right=1 - 0.08 / width, top=1 - 0.62 / height, bottom=0.98 / height, wspace=0.07, hspace=0.54
    )
    for i, (axes, panel) in enumerate(zip(grid, panels, strict=False)):
        inside = cube.isel(ensemble=np.flatnonzero(cube["panel"].values == panel))
        handles = _proof_gains(axes, inside)
        panel_letter(axes, i, panel + (", strength" if panel.startswith("random") else ""))
        axes.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.17), fontsize=8, labelspacing=0.3, ncols=2,
            columnspacing=1.2,
        )  # fmt: skip
        axes.tick_params(labelleft=i % columns == 0)
        if i % columns == 0:
            axes.set_ylabel("gain (decades)")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    _areas(list(grid[: len(panels)]))
    drawn.text(0.56 / width, 1 - 0.2 / height, f"Best trained over best published method{_interval(cube)}", va="center")
    return drawn


def _proof_gains(axes: Axes, inside: xr.Dataset) -> list[Any]:
    handles = []
    axes.axhline(0, color="#404040", linewidth=0.9)
    for k in range(inside["ensemble"].size):
        one = inside.isel(ensemble=k)
        look: dict[str, Any] = {
            "color": CURVES[k % len(CURVES)],
            "marker": MARKERS[k % len(MARKERS)],
            "markersize": 3.8,
        }
        tau, bounds = one["tau_per_stage"].values, one["gain_interval"].values
        axes.fill_between(tau, *bounds.T, color=look["color"], alpha=0.2, linewidth=0)
        (line,) = axes.plot(tau, one["gain"].values, **look, label=_band(str(one["ensemble"].values)))
        handles.append(line)
    step_axis(axes)
    axes.set_xlabel(r"$\tau/s$ (rad)", labelpad=1)
    return handles


def _areas(panels: Sequence[Axes]) -> None:
    """Colour the sides of 0, which share their y axis, and write who is ahead there."""
    low, high = panels[0].get_ylim()
    low, high = min(low, -0.28), max(high, 0.28)
    for axes in panels:
        axes.axhspan(0, high, color=GAINED, linewidth=0, zorder=0)
        axes.axhspan(low, 0, color=LOST, linewidth=0, zorder=0)
        axes.set_ylim(low, high)
        axes.yaxis.set_major_locator(MultipleLocator(0.5))
        for place, says, va in ((0.98, "trained ahead", "top"), (0.02, "published ahead", "bottom")):
            axes.text(0.98, place, says, transform=axes.transAxes, ha="right", va=va, color="#404040", fontsize=8)


def _band(name: str) -> str:
    """Return the label of a curve in a panel whose title has the number of coordinates."""
    return name.partition(", ")[2] if name.startswith("d = ") else name


# --- The figure of ideas: gains against anharmonicity, and a map of the best idea.

#: Name, colour and marker of each idea.
LOOKS = {
    "exact_oscillator": ("oscillator solved exactly, not trained", "#2f7fd6", "D"),
    "trained_exact": ("oscillator solved exactly, trained", "#0d2f6e", "P"),
    "harmonic_conditions": ("harmonic conditions", "#e08214", "s"),
    "nystrom": ("Nyström, order 6 and 8", "#1b7837", "^"),
    "trained": ("trained with T and V", "#c1121f", "o"),
    "general": ("general (Blanes-Moan, ABA, ...)", "#6b6b6b", "v"),
}
#: Number of panels of gains, and lead in decades with full colour in the map.
PANELS, FULL = 3, 0.8
#: Minimum colour saturation of a leader.
PALEST = 0.22


@house_style
def trained_ideas(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` of ``cube`` against anharmonicity at three step sizes, and ``leader`` over both."""
    drawn = new_figure(9.2, 10.2)
    places = np.unique(np.linspace(0, cube["tau_per_stage"].size - 1, PANELS + 2).round().astype(int))
    shown = places[1:-1][:PANELS] if places.size > PANELS + 1 else places[:PANELS]
    width = 0.92 / len(shown)
    top = [drawn.add_axes((0.065 + k * width, 0.695, width - 0.015, 0.235)) for k in range(len(shown))]
    for k, (axes, place) in enumerate(zip(top, shown[::-1], strict=True)):
        one = cube.isel(tau_per_stage=place)
        _ideas_gains(axes, one)
        panel_letter(axes, k, rf"$\tau/s = {float(one['tau_per_stage']):g}$ rad")
    low, high = (f([axes.get_ylim()[k] for axes in top]) for k, f in ((0, min), (1, max)))
    for k, axes in enumerate(top):
        axes.set_ylim(low, high)
        axes.tick_params(labelleft=k == 0)
    top[0].set_ylabel("gain over general methods (decades)")
    says = ("", "which idea is ahead, and by how many decades"), ("_split", "the same where H is split into T and V")
    for k, (suffix, text) in enumerate(says):
        below = drawn.add_axes((0.065, 0.365 - 0.31 * k, 0.905, 0.265))
        _map(below, cube, suffix)
        panel_letter(below, len(shown) + k, text)
    below.set_xlabel(r"anharmonicity: median variation $\delta$ of the Hessian along the orbits", labelpad=2)
    handles = [
        Line2D([], [], color=colour, marker=marker, markersize=4, label=label)
        for label, colour, marker in LOOKS.values()
    ]
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.52, 0.999), ncols=3, columnspacing=1.6)
    return drawn


def _ideas_gains(axes: Axes, one: xr.Dataset) -> None:
    delta = one["anharmonicity"].values[:, 1]
    for idea in map(str, one["idea"].values):
        _, colour, marker = LOOKS[idea]
        values, bounds = (one[key].sel(idea=idea).values for key in ("gain", "gain_interval"))
        axes.fill_between(delta, *bounds.T, color=colour, alpha=0.2, linewidth=0)
        axes.plot(delta, values, color=colour, marker=marker, markersize=3.4)
    log_scale(axes, "x")
    axes.set_xlabel(r"anharmonicity $\delta$", labelpad=1)


def _map(axes: Axes, cube: xr.Dataset, suffix: str) -> None:
    """Draw the leader of each cell of ``cube``, from the variables with this suffix."""
    lead, leader = cube[f"lead{suffix}"].values, cube[f"leader{suffix}"].values
    colours = np.ones((*lead.shape, 3))
    for (t, j), name in np.ndenumerate(leader):
        if np.isfinite(lead[t, j]):
            depth = PALEST + (1 - PALEST) * float(np.clip(lead[t, j] / FULL, 0, 1))
            colours[t, j] = 1 - depth * (1 - np.array(to_rgb(LOOKS[str(name)][1])))
            axes.text(j, t, f"{lead[t, j]:.1f}", ha="center", va="center", fontsize=7, color=text_on(colours[t, j]))
    axes.imshow(colours, aspect="auto", origin="lower")
    delta = cube["anharmonicity"].values[:, 1]
    axes.set_xticks(range(len(delta)), [f"{x:.2g}" for x in delta], fontsize=8)
    axes.set_yticks(range(len(lead)), [f"{x:g}" for x in cube["tau_per_stage"].values], fontsize=8)
    axes.grid(visible=False)
    axes.set_ylabel(r"$\tau/s$ (rad)", labelpad=2)


# --- Tables of docs/results/trained.md and training.md: views of tables of the results, proved properties.

#: The ensemble whose best methods are named, the beginning of the name of orbits, and the ensembles of windows.
WIDEST, KEPLER = "d = 2, 0.01 to 0.5", "Kepler"
WINDOWS = (WIDEST, "d = 3, 0.01 to 0.5", "d = 2, 0.001 to 0.01", "Hénon-Heiles", KEPLER)
WORDS_OF_IDEAS = {
    "exact_oscillator": "oscillator solved exactly", "trained_exact": "oscillator solved exactly (trained)",
    "harmonic_conditions": "harmonic conditions",
    "nystrom": "Nyström", "trained": "trained", "general": "general",
}  # fmt: skip
#: Methods of the table of shifted kicks beside the trained ones: the paper's, and others where such pairs are as plain.
SHIFTED = ("aba104", "abas5o6h", "babs6o5h", "babps6o5h", "babps8o7h", "mclachlan_sb3a4")


@fills
def page(tables: Sequence[str]) -> dict[str, str]:
    """Gains, windows and losses of trained methods, ideas by anharmonicity, long runs, and times."""
    found = tables_of(tables, "trained_")
    every = found["gains"]
    of_orbits, others = ([row for row in every if row["ensemble"].startswith(KEPLER) is yes] for yes in (True, False))
    by_time = [
        (signed(row["gain_lanes"]), signed(row["gain_single"]))
        for row in found["times"]
        if row["ensemble"].startswith(KEPLER)
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
            ("method", *(name if name != KEPLER else "Kepler orbits" for name in WINDOWS), "ensembles with a window"),
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
    """Ideas that lead from the smallest anharmonicity to the largest, each with the anharmonicity at which it ends."""
    return ", ".join(f"{WORDS_OF_IDEAS[idea]} {some[-1]['anharmonicity']:.2g}" for idea, some in grouped(rows, key))


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
