"""Pages on how to use the library: variables of files, errors in other libraries, and what is measured for a page."""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import isnan, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.commands.choice import tailor_answer as answer
from nearharmonic.commands.choice import tailor_arguments as arguments
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics
from nearharmonic.engine.tangent import tangent
from nearharmonic.engine.trajectory import integrate, sweep
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators as registered
from nearharmonic.numerics.portable import Floats, power_law, quasi_random
from nearharmonic.output.answers import printed
from nearharmonic.output.page import pipes
from nearharmonic.output.store import groups_of, read
from nearharmonic.output.table import from_csv
from nearharmonic.plotting.style import (
    house_style,
    log_scale,
    method_handles,
    new_figure,
    panel_letter,
    style_of,
    write_beside,
)
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.systems.system import load_system
from nearharmonic.training.population import Ensemble
from nearharmonic.training.question import Orbit, TailorRequest, orbit_of, question
from nearharmonic.training.tailor import Tailored, comparison, ensembles, tailored
from nearharmonic.training.tailor_search import registered as contenders_of
from nearharmonic.training.tailor_search import step_sizes
from nearharmonic_paper.experiments.stability.run import PERIOD, SYSTEM, kepler_apoapsis
from nearharmonic_paper.pages.filling import fills, power, table

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# --- docs/how_to/files.md, docs/reference/variables.md ----------------------------------------------------------------


@fills
def files(runs: Sequence[str], cubes: Sequence[str]) -> dict[str, str]:
    """Variables of run files and of cubes, each of a dimensionless system and of Kepler's problem."""
    return {"runs": variables_table(map(read, runs)), "cube": variables_table(map(read, cubes))}


@fills
def variables(files: Sequence[str], kinds: Sequence[str], explained: str) -> dict[str, str]:
    """Variables of a file of each kind, named with placeholders; ``explained`` is the page with all attributes."""
    _, _, attributes = Path(explained).read_text(encoding="utf-8").partition("\n## Attributes\n")
    told = re.findall(r"^\| `(\w+)` \|", attributes, re.MULTILINE)
    lines: list[str] = []
    for kind, path in zip(kinds, files, strict=True):
        if unknown := sorted({*read(path).attrs} - {*told}):
            raise NearharmonicError(f"{path} has attributes that {explained} does not explain: {', '.join(unknown)}")
        groups = groups_of(path)
        lines += [f"## `{kind}`"] + [f"In each of the groups {', '.join(f'`{one}`' for one in groups)}:"] * bool(groups)
        lines.append(variables_table(read(path, group=name) for name in groups or (None,)))
    return {"variables": "\n\n".join(lines)}


def variables_table(datasets: Iterator[xr.Dataset]) -> str:
    """A row for each variable of at least one dataset, coordinates of dimensions first.

    A variable whose unit is that of a quantity of Kepler's problem, in which all units differ, has the quantity's name.
    """
    found: dict[str, list[xr.DataArray]] = {}
    for dataset in datasets:
        for name in dataset.variables:
            found.setdefault(str(name), []).append(dataset[name])
    quantity = {unit: name for name, unit in known["kepler"].units.items() if unit != "1"}
    rows = []
    for name in sorted(found, key=lambda name: (name not in found[name][0].dims, name)):
        units = {str(one.attrs["units"]) for one in found[name]}
        unit = next((f"unit of {quantity[one]}" for one in units if one in quantity), min(units))
        meaning = str(found[name][0].attrs["long_name"]).replace("|", "\\|").replace("_", "\\_")
        rows.append((f"`{name}`", ", ".join(map(str, found[name][0].dims)) or "none", unit, meaning))
    return table(("variable", "dimensions", "unit", "meaning"), rows, left=4)


# --- docs/how_to/adapters.md ------------------------------------------------------------------------------------------


@fills
def adapters(errors: str) -> dict[str, Any]:
    """Energy errors inside other libraries, from a file of them."""
    found = from_csv(Path(errors).read_text(encoding="utf-8"))
    names = found.header[4:]
    header = (*found.header[:4], *(f"`{name}`" for name in names))
    return {"errors": "\n".join(pipes(header, found.rows, align="llllr")), "figure": errors_drawn(names, found.rows)}


@house_style
def errors_drawn(names: Sequence[str], rows: Sequence[Sequence[str]]) -> Figure:
    """Draw the errors over that of the first method, as libraries have units of their own: a line for each row."""
    figure = new_figure(7, 0.36 * len(rows) + 1.2)
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.5, right=0.98, top=1 - 0.4 / height, bottom=0.55 / height)
    axes = figure.subplots()
    places = range(len(rows), 0, -1)
    for place, row in zip(places, rows, strict=True):
        errors = [float(cell) / float(row[4]) for cell in row[4:]]
        axes.plot([min(errors), max(errors)], [place, place], color="#c8c8c8", linewidth=1, zorder=1)
        for name, error in zip(names, errors, strict=True):
            axes.plot(error, place, **style_of(name).line(markersize=6, linestyle="none"))
    axes.set_yticks(list(places), [f"{row[0]}: {row[1]} ({row[3]})" for row in rows])
    axes.set(xlabel="energy error over that of leapfrog", ylim=(0.3, len(rows) + 0.7))
    axes.tick_params(axis="y", which="both", length=0)
    log_scale(axes, "x")
    labels = [name if name.startswith("trained_") else registered[name].label for name in names]
    handles = method_handles(names, [text.replace("_", " ") for text in labels])
    figure.legend(handles=handles, loc="upper right", ncols=3)
    return figure


# --- docs/how_to/gauss.md ---------------------------------------------------------------------------------------------

GAUSS = "gauss16"
#: Amplitudes of the Henon-Heiles system, in units of that of the paper's start; the interval; numbers of steps that are
#: tried, and the energy error that the first of them must reach; position and momentum of that start.
AMPLITUDES, UNTIL, STEPS, ERROR = (1.0, 0.3, 0.1, 0.03, 0.01), 500, range(100, 600, 10), 1e-12
START = (0.3, 0.0), (0.0, 0.4)
#: Orbits of the ensemble, the range of their eccentricities, steps in an orbit, and orbits at which errors are taken.
ORBITS, ECCENTRICITIES, STEPS_PER_ORBIT = 32, (0.05, 0.3), 20
TIMES = (16, 64, 256, 1024, 4096, 16384)


@fills
def gauss() -> dict[str, Any]:
    """Iterations of the implicit method with oscillators outside and inside of its equations, growth of its errors."""
    rows = []
    for amplitude in AMPLITUDES:
        steps = next(n for n in STEPS if iterations(amplitude, n, EXACT_OSCILLATOR)[1] <= ERROR)
        outside, inside = (iterations(amplitude, steps, split)[0] for split in (KINETIC_POTENTIAL, EXACT_OSCILLATOR))
        rows.append((f"{amplitude:g}", steps, f"{outside:.1f}", f"{inside:.1f}", f"{1 - inside / outside:.0%}"))
    grown = {summation: growth(summation) for summation in ("plain", "compensated")}
    exponents = {name: power_law(np.array(TIMES, float), errors)[0] for name, errors in grown.items()}
    heads = ("amplitude", "steps", "iterations a step", "with oscillators inside", "fewer")
    return {
        "iterations": table(heads, rows, left=0),
        "growth": table(
            ("sums", *(f"{n} orbits" for n in TIMES), "exponent"),
            ((name, *(f"{x:.0e}" for x in errors), f"{exponents[name]:.2f}") for name, errors in grown.items()),
        ),
        "figure": growth_drawn(grown),
    }


def iterations(amplitude: float, steps: int, split: str) -> tuple[float, float]:
    """Iterations in a step, and the maximum energy error, on Henon-Heiles."""
    q0, p0 = ([amplitude * x for x in row] for row in START)
    run = integrate("henon_heiles", GAUSS, UNTIL / steps, t_end=UNTIL, samples=2, q0=q0, p0=p0, split=split)
    return run.evaluations.item() / (steps * registered[GAUSS].stages), run.max_energy_error.item()


def growth(summation: str) -> Floats:
    """Root mean square of the energy errors of an ensemble of Kepler orbits, at :data:`TIMES`."""
    u, (low, high) = quasi_random(ORBITS, 2, 1), ECCENTRICITIES
    start = kepler_apoapsis(low + (high - low) * u[:, 0], 2 * pi * u[:, 1])
    marks = np.tile([0, *(STEPS_PER_ORBIT * orbits for orbits in TIMES)], (ORBITS, 1))
    paths = integrate_batch(
        SYSTEM, registered[GAUSS], t_end=Fraction(TIMES[-1]) * PERIOD, steps=marks[:, -1], samples=marks.shape[1],
        start=start, marks=marks, numerics=Numerics(summation=summation, energy="samples"),
    )  # fmt: skip
    found: Floats = np.sqrt((paths.energy_error[:, 1:] ** 2).mean(axis=0))
    return found


@house_style
def growth_drawn(grown: Mapping[str, Floats]) -> Figure:
    """Draw the growth of the energy errors, with the slope of a random walk."""
    figure = new_figure(4.5, 3)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.17, right=0.97, top=0.97, bottom=0.17)
    for (summation, errors), look in zip(grown.items(), (("#e86a10", "s"), ("#0b3c8c", "o")), strict=True):
        axes.plot(TIMES, errors, label=f"{summation} sums", color=look[0], marker=look[1])
    first = 0.4 * min(errors[0] for errors in grown.values())
    axes.plot(TIMES, [first * (n / TIMES[0]) ** 0.5 for n in TIMES], color="#808080", linestyle=":", label=r"$t^{1/2}$")
    axes.set(xlabel="orbits", ylabel="rms energy error")
    log_scale(axes, "xy")
    axes.legend()
    return figure


# --- docs/how_to/tabulated_potentials.md ------------------------------------------------------------------------------

FORMS = {"Chebyshev series": "#0b3c8c", "quintic spline": "#00a070", "cubic spline": "#e86a10"}
#: Step sizes per stage, even in the logarithm, the errors for which the largest is sought, and those between which a
#: slope is fitted.
LADDER, SOUGHT, BETWEEN = np.geomspace(2e-4, 0.15, 120), (1e-6, 1e-8, 1e-10), (1e-12, 1e-6)
#: Methods, and lines of a slope in their panels: slope, and step size and error at the beginning of the line.
GUIDES = {
    "babps8o7h": ((3, 1e-3, 1e-6), (4, 0.02, 1e-12)),
    "s17odr8a": ((3, 1e-3, 1e-5), (5, 7e-4, 1e-11), (8, 0.02, 1e-12)),
}

Errors = Mapping[str, Mapping[str, Floats]]


@fills
def tabulated_potentials(blocks: str) -> dict[str, Any]:
    """Distances of fits from a table, and energy errors with three forms of it, which the blocks of the page define."""
    series, _, spline = re.findall(r"```python\n(.*?)```", Path(blocks).read_text(encoding="utf-8"), re.DOTALL)
    codes = (series, spline, spline.replace("DEGREE = 5", "DEGREE = 3"))
    forms: dict[str, dict[str, Any]] = {form: {} for form in FORMS}
    for code, names in zip(codes, forms.values(), strict=True):
        exec(compile(code, blocks, "exec"), names)
    found = {
        method: {
            form: sweep(names["well"], method, LADDER * registered[method].stages).max_energy_error.values
            for form, names in forms.items()
        }
        for method in GUIDES
    }
    q, energies = (forms["Chebyshev series"][name] for name in ("q", "table"))
    between, degrees = np.linspace(-2, 2, 401), []
    for degree in (2, 4, 6, 8, 10, 12):
        fit = np.polynomial.Chebyshev.fit(q, energies, degree)
        off = abs(fit(q) - energies).max(), abs(fit(between) - (between**4 / 4 - between**2 / 2)).max()
        degrees.append((degree, *(f"{x:.5f}" for x in off)))
    return {
        "degrees": table(("degree", "from the table", "from the exact energy"), degrees, left=0),
        "steps": table(("method", "form of the table", "slope", *map(power, SOUGHT)), steps_to_errors(found), left=2),
        "figure": forms_drawn(found),
    }


def steps_to_errors(found: Errors) -> Iterator[tuple[str, ...]]:
    """A row for each method and form: its slope, and the largest step sizes up to which all errors are below bounds.

    In brackets is the factor by which a step size is smaller than that of the first form.
    """
    for method, several in found.items():
        best: list[float] = []
        for form, errors in several.items():
            counts = [next(iter(np.flatnonzero(~(errors <= bound))), errors.size) for bound in SOUGHT]
            sizes = [float(LADDER[count - 1]) if count else float("nan") for count in counts]
            best = best or sizes
            cells = (
                f"below {LADDER[0]:.2g}" if isnan(size) else f"{size:.2g}" + f" ({first / size:.2g})" * (size != first)
                for size, first in zip(sizes, best, strict=True)
            )
            inside = (errors > BETWEEN[0]) & (errors < BETWEEN[1])
            slope = np.polyfit(np.log(LADDER[inside]), np.log(errors[inside]), 1)[0]
            yield f"`{method}`", form, f"{slope:.1f}", *cells


@house_style
def forms_drawn(found: Errors) -> Figure:
    """Draw the errors against the step size, a panel for each method, with lines of the expected slopes."""
    figure = new_figure(7, 3.6)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.84, bottom=0.13, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for position, (axes, (method, several)) in enumerate(zip(panels, found.items(), strict=True)):
        for form, errors in several.items():
            axes.plot(LADDER, errors, label=form, color=FORMS[form], linestyle="-")
        for slope, step, size in GUIDES[method]:
            ends = np.array([step, 3 * step])
            axes.plot(ends, size * (ends / step) ** slope, "--", color="#404040", linewidth=0.9)
            write_beside(axes, f"slope {slope}", (ends[0], size), (-4, 2), ha="right")
        panel_letter(axes, position, f"{registered[method].label}, order {registered[method].order}")
        axes.set(xlabel=r"step size per stage, $\tau/s$", ylim=(1e-16, 1))
        log_scale(axes, "xy")
    panels[0].set_ylabel(r"max $|\Delta H|$ / height of the barrier")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.54, 1), ncols=3)
    return figure


# --- docs/how_to/tangent_maps.md --------------------------------------------------------------------------------------

#: Energies of the panels, those of Figures 5 and 6 of Henon & Heiles (1964), doi:10.1086/109234.
ENERGIES = (Fraction(1, 8), Fraction(1, 6))
#: Points of a panel along each axis, edges of both axes (all starts of the energy 1/6 are inside), and the time.
SIZE, EDGES, T_END = 512, ((-0.5, 1.0), (-0.6, 0.6)), 1000
#: MEGNO above which an orbit counts as chaotic. It is 2 for a regular orbit, with oscillations that decay like 1/t, and
#: exceeds 4 after eight Lyapunov times.
CHAOTIC = 4.0
#: Exponents at both ends of the colours; that of a regular orbit falls like (ln t)/t, which is 0.007 at the end. The
#: number of colours: with those of a continuous map the picture of so many points is twice as large.
EXPONENTS, COLOURS = (0.003, 0.15), 17


@fills
def tangent_maps() -> dict[str, Any]:
    """Chaos on the surface of section of Henon and Heiles: quantiles of exponents, and a map of them."""
    rows, images = [], {}
    for energy in ENERGIES:
        runs, images[energy] = chaos(energy)
        last, errors = runs.isel(sample=-1), runs.max_energy_error.values
        exponent, chaotic = last.lyapunov_exponent.values, last.megno.values > CHAOTIC
        spread = np.quantile(exponent[chaotic], [0.1, 0.5, 0.9])
        regular, error = np.median(last.megno.values[~chaotic]), errors[np.isfinite(errors)].max()
        share = f"{round(100 * chaotic.sum() / chaotic.size)} %"
        rows.append((energy, chaotic.size, share, *(f"{x:.3f}" for x in spread), f"{regular:.2f}", f"{error:.0e}"))
    heads = ("H", "starts", "chaotic", "exponent, lowest tenth", "median", "highest tenth", "MEGNO of the others")
    return {"chaos": table((*heads, "largest energy error"), rows), "figure": chaos_drawn(images)}


def chaos(energy: Fraction) -> tuple[Any, Floats]:
    """Orbits of an energy from a grid of y and p_y with x = 0 and p_x > 0, and the exponents on it, NaN outside."""
    y, momentum = np.meshgrid(*(low + (high - low) * (np.arange(SIZE) + 0.5) / SIZE for low, high in EDGES))
    square = 2 * float(energy) - momentum**2 - y**2 + 2 * y**3 / 3
    inside = (square > 0) & (y < 1)  # beyond y = 1 the potential falls again
    q0 = np.stack([0 * y[inside], y[inside]], axis=1)
    p0 = np.stack([np.sqrt(square[inside]), momentum[inside]], axis=1)
    runs = tangent("henon_heiles", "babps8o7h", 0.5, t_end=T_END, samples=11, deviations=1, q0=q0, p0=p0)
    image = np.full(y.shape, np.nan)
    image[inside] = np.clip(runs.lyapunov_exponent.values[:, -1], *EXPONENTS)
    return runs, image


@house_style
def chaos_drawn(images: Mapping[Fraction, Floats]) -> Figure:
    """Draw the starts of each energy in a panel, coloured by the largest exponent on a logarithmic scale."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    figure = new_figure(7, 3.5)
    figure.subplots_adjust(left=0.09, right=0.865, top=0.92, bottom=0.14, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for position, (axes, (energy, image)) in enumerate(zip(panels, images.items(), strict=True)):
        drawn = axes.imshow(
            image, origin="lower", extent=(*EDGES[0], *EDGES[1]), norm=LogNorm(*EXPONENTS),
            cmap=colormaps["viridis"].resampled(COLOURS), interpolation="nearest", aspect="auto",
        )  # fmt: skip
        axes.set(xlabel="$y$", xlim=EDGES[0], ylim=EDGES[1], xticks=[-0.25, 0, 0.25, 0.5, 0.75])
        axes.grid(visible=False)
        panel_letter(axes, position, f"$H = {energy}$")
    panels[0].set_ylabel("$p_y$")
    bar = figure.colorbar(drawn, cax=figure.add_axes((0.88, 0.14, 0.018, 0.78)))
    bar.set_ticks(ticks := [0.003, 0.01, 0.03, 0.1], labels=list(map(str, ticks)))
    bar.minorticks_off()
    bar.set_label("Lyapunov exponent at t = 1000")
    return figure


# --- docs/how_to/tailor.md --------------------------------------------------------------------------------------------

#: Systems, those of the examples by the names of their files, and trials of their searches among six to twelve stages.
TAILORED = (
    "henon_heiles", "kepler", "relativistic_oscillator", "morse", "pendulum", "quartic_well", "double_well",
    "toda_chain", "outer_solar_system", "driven_oscillator",
)  # fmt: skip
TRIALS = 12_000
#: Over-fitting: systems with stages, starts of the search, trials, and draws of as many starts whose mean is shown.
OVER = (("henon_heiles", 8), ("morse", 9), ("kepler", 12))
STARTS, OVER_TRIALS, DRAWS = (1, 2, 4, 8, 16, 32), 4000, 3
#: Elsewhere: a method for H0 = 1/8 at 0.08 to 0.12 on other step sizes, and on other energies.
OTHER_STEPS, OTHER_ENERGIES = (0.03, 0.05, 0.065, 0.08, 0.1, 0.12, 0.15, 0.18), (0.001, 0.01, 0.04, 0.08, 0.125, 0.15)


@fills
def tailor(files: Sequence[str]) -> dict[str, str]:
    """Output of the command, gains on ten systems, over-fitting, and gains elsewhere. ``files`` are the examples.

    Budgets are numbers of trials, so that a seed gives the same rows on one kind of processor.
    """
    examples = {Path(path).stem: path for path in files}
    subjects = {name: load_system(examples[name]) if name in examples else known[name] for name in TAILORED}
    parser = ArgumentParser()
    arguments(parser)
    shown = answer(parser.parse_args(["henon_heiles", "--window", "0.08:0.12", "--trials", "6000"]))
    heads = ("system", "window", "best registered", "stages", "on the starts of the search", "on others")
    made = (tailored(question(one, stages="6:12", trials=TRIALS)) for one in subjects.values())
    return {
        "example": f"```\n{printed(shown, 'table')}```",
        "gains": table(heads, map(gain_row, made), left=6),
        "over-fitting": table(
            ("system", "starts", "on these", "on others", "difference"),
            (row for name, stages in OVER for row in over_fitting(subjects[name], stages)),
        ),
        "elsewhere": elsewhere(),
    }


def gain_row(found: Tailored) -> tuple[str, ...]:
    """Window, best registered methods and gains on a system, bold where the new method is ahead."""
    unit = found.question.system.units["t"]
    window = f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"
    best = ", ".join(f"`{name}`" for name in dict.fromkeys(found.test.best))
    test = f"**{found.test.gain}**" if found.has_gain else str(found.test.gain)
    return found.question.system.label, window, best, str(found.tableau.stages), str(found.training.gain), test


def over_fitting(system: System, stages: int) -> Iterator[tuple[object, ...]]:
    """Gains by the number of starts, on these and on 64 others, means of several draws."""
    rows, d = [], system.dimension
    for seed in range(100, 100 + DRAWS):
        both = ensembles(question(system, seed=seed), orbit_of(system))
        rows += [np.hstack([one.start[:, :d], one.start[:, 2 * d : 3 * d]]) for one in both]
    starts = np.vstack(rows)

    def gains(count: int, draw: int) -> tuple[float, float]:
        def few(asked: TailorRequest, orbit: Orbit) -> tuple[Ensemble, Ensemble]:
            first, second = ensembles(replace(asked, starts=starts, seed=0), orbit)
            picked = np.random.default_rng([draw, count]).permutation(first.size)[:count]
            return first.part(picked), second.part(slice(64))

        found = tailored(question(system, stages=stages, trials=OVER_TRIALS, seed=draw), starts=few)
        return found.training.gain.mean, found.test.gain.mean

    for count in STARTS:
        own, others = np.mean([gains(count, draw) for draw in range(DRAWS)], axis=0)
        yield system.label, count, *(f"{gain:.2f}" for gain in (own, others, own - others))


def elsewhere() -> str:
    """Gains of one method on other step sizes and energies."""
    asked = question(known["henon_heiles"], window="0.08:0.12", energy="same", trials=6000)
    found = tailored(asked)
    others = contenders_of(asked.system)
    wide = comparison(found.tableau, others, found.held_out, np.array(OTHER_STEPS), 0)
    gains = []
    for energy in OTHER_ENERGIES:
        there = ensembles(replace(asked, energy=energy, scale=energy), orbit_of(asked.system))[1]
        ensemble = replace(there, t_end=found.held_out.t_end)
        gains.append(comparison(found.tableau, others, ensemble, step_sizes(found.window), 0).gain)
    return "\n\n".join(
        table((head, *(f"{x:g}" for x in values)), [(row, *(f"{gain.mean:.2f}" for gain in some))])
        for head, values, row, some in (
            ("tau/s", OTHER_STEPS, "gain at H = 1/8", wide.gains),
            ("H", OTHER_ENERGIES, "gain at tau/s = 0.08 to 0.12", gains),
        )
    )
