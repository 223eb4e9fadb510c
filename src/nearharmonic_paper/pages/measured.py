"""Pages whose numbers are measured for them alone: methods and their ranking, and pages on how to use the library."""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import exp, inf, isfinite, isnan, log, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.commands.tailor import answer, arguments
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics, misfit, steps_of
from nearharmonic.engine.tangent import tangent
from nearharmonic.engine.trajectory import integrate, sweep
from nearharmonic.integrators import implicit_integrators, modified_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.math import cos
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.statistics import power_law, quasi_random
from nearharmonic.output.answers import printed
from nearharmonic.output.page import pipes
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
from nearharmonic.recommendation.measure import LOSSLESS, prepared_calls
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.systems.system import load_system
from nearharmonic.theory.order import harmonic_order, order_of
from nearharmonic.training.population import Ensemble
from nearharmonic.training.published import published_names
from nearharmonic.training.question import Orbit, TailorRequest, orbit_of, question
from nearharmonic.training.tailor import Tailored, comparison, ensembles, tailored
from nearharmonic.training.tailor_search import registered as contenders_of
from nearharmonic.training.tailor_search import step_sizes
from nearharmonic_paper.experiments.stability.kepler.run import PERIOD, SYSTEM, kepler_apoapsis
from nearharmonic_paper.pages.filling import fills, power, table
from nearharmonic_paper.tasks.receipts import measures_time

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# --- docs/reference/methods.md ----------------------------------------------------------------------------------------

#: Step sizes per stage at which methods with modified potentials are compared, the heads of their columns, and the time
#: of a force with the gradient of its square over that of a force.
COMPARED = {"henon_heiles": ((0.05, 0.1, 0.2), "Hénon-Heiles, τ/s = {:g}", 2.1),
            "kepler": ((10, 20, 40), "Kepler, {:g} h", 1.3)}  # fmt: skip
#: Methods without a modified potential in this table.
PLAIN = ("ruth", "srkn_b6", "srkn_b11", "srkn_a14", "nystrom_6a8", "babps8o7h")


@fills
def methods() -> dict[str, str]:
    """Proved orders of all methods, and errors of those with a modified potential."""
    first = ("name", "label", "composition", "stages")
    found = {}
    for kind, names, heads in (
        ("methods", plain_integrators, ("order", "order for quadratic T", "harmonic order")),
        ("modified", modified_integrators, ("gradients", "order", "harmonic order")),
        ("implicit", implicit_integrators, ("order", "harmonic order")),
    ):
        rows = []
        for one in map(registered.__getitem__, names.registered):
            order = order_of(one)
            proved = {
                "order": order, "order for quadratic T": one.order if one.requires else order,
                "gradients": getattr(one, "gradients", ""), "harmonic order": harmonic_order(one),
            }  # fmt: skip
            composition = "implicit" if one.implicit else {"drift": "ABA", "kick": "BAB"}[one.first]
            rows.append((f"`{one.name}`", one.label, composition, one.stages, *(proved[head] for head in heads)))
        found[kind] = table((*first, *heads), rows, left=3)
    compared = (*modified_integrators.registered, *PLAIN)
    header = ("name", *(head.format(tau) for taus, head, _ in COMPARED.values() for tau in taus))
    return found | {"errors": table(header, ((f"`{name}`", *decades(name)) for name in compared))}


def decades(name: str) -> Iterator[str]:
    """log10 of the errors of a method at equal numbers of evaluations, and in brackets at equal times."""
    one = registered[name]
    for system, (taus, _, factor) in COMPARED.items():
        at = [[tau * one.stages * charge for tau in taus] for charge in (1, factor)]
        equal, charged = (np.log10(sweep(system, one, steps).max_energy_error.values) for steps in at)
        yield from (f"{a:.1f} ({b:.1f})" if one.modified else f"{a:.1f}" for a, b in zip(equal, charged, strict=True))


# --- docs/results/ranking.md ------------------------------------------------------------------------------------------

RANKED = (1e-3, 1e-6, 1e-9, 1e-12)
#: Evaluations of the runs of a curve: 15 % more from one to the next.
RATIO, FEWEST, MOST = 1.15, 150, 1_500_000
#: Methods in a row, those that are timed for it besides implicit ones, and repeats.
PLACES, CANDIDATES = 3, 12
REPEATS = Patience(least=7, most=15, seconds=0.05)


class Place(NamedTuple):
    """What a method takes to an error: evaluations, interpolated, and the steps and sums of a run that meets it."""

    evaluations: float
    method: str
    steps: int
    summation: str


@measures_time
@fills
def ranking() -> dict[str, str]:
    """All methods on five systems, by evaluations of the force and by time."""
    with pinned():
        tables = [f"## {title}, t = {t_end}\n\n{ranked(system, t_end)}" for title, system, t_end in contests()]
    return {"ranking": "\n\n".join(tables), "machine": f"Machine: {processor()}."}


def contests() -> list[tuple[str, System, str]]:
    """Titles, systems and intervals, from near-harmonic to not."""

    def chain(q: Sequence[Any]) -> Any:
        return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise((0, *q, 0)))

    def pair(q: Sequence[Any]) -> Any:
        x, y = q
        return (x * x + 2 * y * y) / 2 + (x**4 + y**4) / 8 + x * x * y * y / 2

    first_mode = tuple(f"{np.sin(np.pi * (i + 1) / 9):.6f}" for i in range(8))
    pendulum = System(name="pendulum", V=lambda q: -cos(q[0]), q0=("1",), p0=("0",), t_end="200")
    quartic = System(name="quartic_pair", V=pair, q0=("1", "0.5"), p0=("0", "0.3"), t_end="200")
    fput = System(name="fput_8", V=chain, q0=first_mode, p0=("0",) * 8, t_end="400")
    return [
        ("Hénon-Heiles, H = 1/8", known["henon_heiles"], "200"),
        ("Kepler, e = 0.206", known["kepler"], "87660"),
        ("pendulum, 1 rad", pendulum, "200"),
        ("quartic pair", quartic, "200"),
        ("FPUT-8, first mode", fput, "400"),
    ]


def ranked(system: System, t_end: str) -> str:
    """The table of a system."""
    names = (*plain_integrators.registered, *implicit_integrators.registered)
    curves = {name: found for name in names if (found := curve(system, t_end, name)) is not None}
    rows = []
    for error in RANKED:
        places = sorted(place for name, found in curves.items() if (place := reached(name, found, error)))
        public = [place for place in places if place.method in published_names()]
        counts = (", ".join(f"{registered[one.method].label} {one.evaluations:.0f}" for one in some[:PLACES])
                  for some in (places, public))  # fmt: skip
        times = (
            f"{registered[name].label} {1e6 * time:.0f} µs" for time, name in timed(system, t_end, places)[:PLACES]
        )
        rows.append((f"{error:.0e}", *counts, ", ".join(times)))
    return table(("error", "fewest evaluations", "of published methods", "shortest time"), rows, left=4)


def curve(system: System, t_end: str, name: str) -> Floats | None:
    """Steps, evaluations, errors with compensated and with plain sums (4, n) of a method, None if it does not fit."""
    tableau, found = registered[name], []
    if misfit(system, tableau)[0]:
        return None
    ladder = (FEWEST * RATIO**k for k in range(int(log(MOST / FEWEST, RATIO)) + 1))
    counts = list(dict.fromkeys(max(1, round(n / tableau.stages)) for n in ladder))
    for i in range(0, len(counts), 8):
        taus = [float(t_end) / n for n in counts[i : i + 8]]
        careful, plain = (sweep(system, tableau, taus, t_end=t_end, summation=way) for way in ("compensated", "plain"))
        errors = careful.max_energy_error.values
        found.append(np.stack([plain.steps, plain.evaluations, errors, plain.max_energy_error]))
        if errors.max() < RANKED[-1]:
            break
    return np.concatenate(found, axis=1)


def reached(name: str, found: Floats, error: float) -> Place | None:
    """What a method takes to an error which all finer runs meet; None if it does not reach it."""
    steps, evaluations, errors, plain = found
    missed = np.flatnonzero(~(errors <= error))
    first = int(missed[-1]) + 1 if missed.size else 0
    if first == errors.size:
        return None
    count = float(evaluations[first])
    if first and isfinite(errors[first - 1]):
        (x, u), (y, v) = (np.log(row[first - 1 : first + 1]) for row in (evaluations, errors))
        count = exp(x + (u - x) * (log(error) - y) / (v - y))
    lossless = plain[first] <= LOSSLESS * errors[first]  # the cheaper sums that lose nothing
    return Place(count, name, int(steps[first]), "plain" if lossless else "compensated")


def timed(system: System, t_end: str, places: Sequence[Place]) -> list[tuple[float, str]]:
    """Seconds of the methods that lead by evaluations, and of implicit ones, the fastest first."""
    some = [one for i, one in enumerate(places) if i < CANDIDATES or registered[one.method].implicit]
    calls = [
        prepared_calls(
            system, registered[one.method], t_end, steps_of(t_end, float(t_end) / one.steps), one.summation,
            modes=("trajectory",),
        )["trajectory"]
        for one in some
    ]  # fmt: skip
    times = (min(each, default=inf) for each in interleaved(calls, REPEATS))
    return sorted(zip(times, (one.method for one in some), strict=True))


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
    """What the command prints, gains on ten systems, over-fitting, and gains elsewhere. ``files`` are the examples.

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
