"""Errors of all methods on the examples by anharmonicity.

The measure of anharmonicity is the variation of the Hessian, delta = rms |W - mean W| / rms |W| along the orbit, where
W is V'' between coordinates that are scaled by the square roots of the masses, and |.| the Frobenius norm. It is 0 for
every harmonic system, whatever its frequencies and amplitudes, and at most 1.

Run: ``python benchmarks/near_harmonic.py``; ``--page`` writes tables and figure to ``docs/results/examples.md``.
Nothing is timed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, isnan, log, log10, nan, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
import xarray as xr
from timing import ROOT, fill

from nearharmonic.engine.trajectory import integrate, sweep
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.numerics.portable import Floats
from nearharmonic.plotting.style import house_style, new_figure, panel_letter
from nearharmonic.systems import System, systems
from nearharmonic.systems.system import load_system
from nearharmonic_paper.pages.filling import signed, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, PICTURE = "docs/results/examples.md", "near_harmonic.svg"
#: The methods of the paper's figures: its own, and those that it compares them with.
NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
SIX = ("ruth", "s5odr4", "aba104", "aba864", "aba1064", "yoshida_s7o6a")
#: What the sources of the rest of the paper's Table 4 and of the methods found here begin with.
OWN = ("Nielsen", "found by", "trained by")
#: Evaluations of the force in the shortest period 2 pi / omega, omega^2 the largest |eigenvalue| of W on the orbit.
COSTS = (25, 50, 100)
#: A method's error is the median over these multiples of the step size, which no single resonance decides.
AROUND = (0.9, 0.95, 1.0, 1.05, 1.1)
#: Shortest periods that a run covers, if the system's own interval is not shorter; samples of the Hessian.
PERIODS, SAMPLES = 100, 257
#: Coordinates up to which W is formed; beyond, its norms are found from products with random vectors.
FORMED = 40
#: Energy errors that are made of rounding alone.
ROUNDING = 1e-15
#: Frequencies of the drives where they are higher than the oscillator's.
DRIVES = {"paul_trap": 2.0, "driven_oscillator": 1.5}
#: Bands of delta in the first table.
BANDS = (0, 0.01, 0.1, 0.5, 1.01)
#: Markers and colours of the families in the figure.
LOOKS = tuple(zip("osD^vP", ("#0b3c8c", "#e86a10", "#00a070", "#8e3fb5", "#8b0000", "#4a90e2"), strict=True))


def others() -> tuple[str, ...]:
    """Return the names of all registered methods of other authors."""
    return tuple(name for name in plain_integrators.registered if not integrators[name].source.startswith(OWN))


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """A system from its own initial values, or from others; ``amplitude`` is their name in a table."""

    system: System
    family: str
    amplitude: str = ""
    start: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Result:
    """An orbit, its delta, and the energy error of each method by cost and name."""

    orbit: Orbit
    delta: float
    errors: Mapping[int, Mapping[str, float]]

    def best(self, cost: int, names: Sequence[str]) -> str:
        """Return the method of the smallest error."""
        return min(names, key=self.errors[cost].__getitem__)

    def gain(self, cost: int, names: Sequence[str]) -> float:
        """Decades by which the best of NEW is better than the best of ``names``; NaN where one fails or only rounds."""
        new, other = (self.errors[cost][self.best(cost, group)] for group in (NEW, names))
        return log10(other / new) if max(new, other) < 1 and min(new, other) > ROUNDING else nan

    def gains(self) -> list[str]:
        """Gains over the six and over all others, each at every cost."""
        return [signed(self.gain(cost, names), 1) for names in (SIX, others()) for cost in COSTS]


def parts():
    """Gains of the new methods on the examples, on families of orbits, and by bands of delta."""
    found = examples_in((ROOT / "examples").glob("*.py"))
    of_examples, of_families = (list(map(measured, orbits)) for orbits in (orbits_of(found), families(found)))
    twice = {one.orbit.system.name for one in of_families}
    results = [*of_families, *(one for one in of_examples if one.orbit.system.name not in twice)]
    return {
        "bands": table_of_bands(results),
        "examples": table_of_examples(of_examples),
        "families": table_of_families(of_families),
        "figure": gains_drawn(results),
    }


def table_of_examples(results: Sequence[Result]) -> str:
    """Return a row for each example and cost."""
    header = ("example", "forces", "δ", "best of the ten", "error", "best of other authors", "error",
              "gain over the six", "gain over all")  # fmt: skip
    rows = []
    for result in sorted(results, key=lambda one: one.delta):
        name, every = result.orbit.family, result.gains()
        for i, cost in enumerate(COSTS):
            head = (f"[{name}](../../examples/{name}.py)", cost, f"{result.delta:.2g}") if i == 0 else ("", cost, "")
            cells: list[str] = []
            for best in (result.best(cost, names) for names in (NEW + SIX, others())):
                error = result.errors[cost][best]
                shown = "rounding" if error < ROUNDING else f"{error:.0e}" if error < 1 else "fails"
                cells += [integrators[best].label, shown]
            rows.append((*head, *cells, every[i], every[i + len(COSTS)]))
    return table(header, rows, left=2)


def table_of_families(results: Sequence[Result]) -> str:
    """Return a row for each orbit of the families."""
    header = ("orbit", "amplitude", "δ", *(f"over {whom}, {cost}" for whom in ("the six", "all") for cost in COSTS))
    rows, above = [], ""
    for one in results:
        family = one.orbit.family if one.orbit.family != above else ""
        rows.append((family, one.orbit.amplitude, f"{one.delta:.2g}", *one.gains()))
        above = one.orbit.family
    return table(header, rows, left=2)


def table_of_bands(results: Sequence[Result]) -> str:
    """Return the smallest, median and largest gain of the orbits whose delta is in a band."""
    rows = []
    for low, high in pairwise(BANDS):
        inside = [one for one in results if low <= one.delta < high]
        for names, whom in ((SIX, "the other six"), (others(), "all others")):
            cells = []
            for cost in COSTS:
                gains = [gain for one in inside if not isnan(gain := one.gain(cost, names))]
                least, middle, most = (signed(float(f(gains)), 1) for f in (min, np.median, max))
                cells.append(f"{least} / **{middle}** / {most}")
            rows.append((f"{low:g} to {high:g} ({len(inside)} orbits)" if names is SIX else "", whom, *cells))
    return table(("δ", "compared with", *(f"{cost} forces" for cost in COSTS)), rows, left=2)


@house_style
def gains_drawn(results: Sequence[Result]) -> Figure:
    """Gain against delta at the middle cost, a marker for each family, the other examples as crosses."""
    from matplotlib.lines import Line2D

    figure = new_figure(7, 6.4)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.88, bottom=0.08, hspace=0.15)
    panels = figure.subplots(2, 1, sharex=True)
    looks = iter(LOOKS)
    seen: dict[str, dict[str, Any]] = {}
    for result in results:
        family = result.orbit.family if result.orbit.amplitude else "other examples"
        if family not in seen:
            marker, colour = next(looks) if result.orbit.amplitude else ("x", "#595959")
            seen[family] = {"marker": marker, "color": colour, "linestyle": "none"}
        for axes, names in zip(panels, (SIX, others()), strict=True):
            axes.plot(result.delta, result.gain(COSTS[1], names), **seen[family])
    compared = ("the other six of the paper", "all methods of other authors")
    for axes, letter, whom in zip(panels, "AB", compared, strict=True):
        axes.axhline(0, color="#404040", linewidth=0.8)
        axes.set(xscale="log", xlim=(1e-4, 1.3), ylabel="gain (decades)")
        panel_letter(axes, letter, f"over {whom}, {COSTS[1]} forces in the shortest period")
    panels[1].set_xlabel(r"variation of the Hessian along the orbit, $\delta$")
    handles = [Line2D([], [], label=family, **look) for family, look in seen.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.54, 1), ncols=4)
    return figure


# --- orbits and their measurement -------------------------------------------------------------------------------------


def examples_in(files: Iterable[str | Path]) -> dict[str, System]:
    """Return the systems that files define, by the names of the files, in their order."""
    paths = sorted(map(Path, files))
    return {path.stem: load_system(str(path)) for path in paths if "SYSTEM =" in path.read_text(encoding="utf-8")}


def orbits_of(examples: Mapping[str, System]) -> list[Orbit]:
    """Return an orbit of each example whose V is an expression, from which a Hessian is derived."""
    return [Orbit(system=one, family=name) for name, one in examples.items() if one.energies[0].traced]


def families(examples: Mapping[str, System]) -> Iterator[Orbit]:
    """Yield orbits of six systems, from small amplitudes to large ones."""
    for a in (0.05, 0.1, 0.2, 0.5, 1, 1.5, 2, 2.5, 3):
        yield Orbit(system=examples["pendulum"], family="pendulum", amplitude=f"{a} rad", start={"q0": [a]})
    for e in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.9):
        start = {"q0": [-log(1 - e)]}
        yield Orbit(system=examples["morse"], family="Morse oscillator", amplitude=f"H = {e * e:.2g} D", start=start)
    for a in (0.02, 0.05, 0.1, 0.2, 0.4, 1):
        q, p = (0.3 * a, 0.2 * a), (0.3 * a, -0.2 * a)
        label = f"H = {systems['henon_heiles'].energy(q, p):.2g}"
        yield Orbit(system=systems["henon_heiles"], family="Hénon-Heiles", amplitude=label, start={"q0": q, "p0": p})
    for name, scales in (("quartic_well", (0.05, 0.1, 0.3, 1, 3)), ("toda_chain", (0.05, 0.2, 0.5, 1, 2)),
                         ("fput_recurrence", (0.1, 0.3, 1, 3, 6))):  # fmt: skip
        system = examples[name]
        q0, p0 = system.start(float)
        for a in scales:
            start = {"q0": [a * x for x in q0], "p0": [a * x for x in p0]}
            yield Orbit(system=system, family=system.label, amplitude=f"{a} × the example's", start=start)


def hessian_of(system: System, run: xr.Dataset) -> Callable[[Floats], Floats]:
    """W = M^(-1/2) V'' M^(-1/2) at each place of a run, as a map of rows (n, d), or of one row for all (d,)."""
    formulas, parameters, d, n = system.formulas(), system.constants(float), system.dimension, len(run.t)
    rows = np.eye(formulas.dimension)[:d]
    of_T = [formulas.hessian_T_times(rows[0], row, *parameters)[i] for i, row in enumerate(rows)]
    scales = np.sqrt(np.array(of_T, float))  # masses are diagonal in all examples
    places = (*run.q.values.T, *[run.t.values] * bool(system.time_dependent))

    def times(x: Floats) -> Floats:
        scaled = (*np.broadcast_to(x * scales, (n, d)).T, *[np.zeros(n)] * (len(places) - d))
        product = formulas.hessian_V_times(places, scaled, *parameters)
        found: Floats = np.stack([np.broadcast_to(row, n) for row in product[:d]], axis=-1) * scales
        return found

    return times


def variation(orbit: Orbit, tau: float, t_end: float) -> tuple[float, float]:
    """delta and omega of an orbit, from a run with step size ``tau``, which need only be fine enough to follow it."""
    system, d = orbit.system, orbit.system.dimension
    samples = SAMPLES if d <= FORMED else 9
    run = integrate(system, "s15odr8", tau, t_end=t_end, samples=samples, energy="none", **orbit.start)
    hessian, random = hessian_of(system, run), np.random.default_rng(1)
    probes = np.eye(d) if d <= FORMED else random.choice([-1.0, 1.0], (16, d))
    columns = np.stack([hessian(probe) for probe in probes])
    delta = np.sqrt(((columns - columns.mean(axis=1, keepdims=True)) ** 2).sum() / (columns**2).sum())
    x = random.normal(size=(len(run.t), d))
    for _ in range(100 if d <= FORMED else 30):  # the power method at each sample
        x = hessian(x / np.linalg.norm(x, axis=-1, keepdims=True))
    return float(delta), float(f"{np.sqrt(np.linalg.norm(x, axis=-1).max()):.3g}")


def measured(orbit: Orbit) -> Result:
    """Measure an orbit, and all methods on it."""
    system, whole = orbit.system, float(orbit.system.t_end)
    steps = 20000 if system.dimension <= FORMED else 2000
    _, omega = variation(orbit, whole / steps, whole)
    t_end = min(whole, PERIODS * 2 * pi / omega)
    delta, omega = variation(orbit, t_end / steps, t_end)
    period = 2 * pi / max(omega, DRIVES.get(system.name, 0))
    errors = {
        cost: {name: median_error(orbit, name, period / cost, t_end) for name in (*NEW, *others())} for cost in COSTS
    }
    return Result(orbit=orbit, delta=delta, errors=errors)


def median_error(orbit: Orbit, name: str, tau_per_stage: float, t_end: float) -> float:
    """Return the median over AROUND of the largest energy error of a method."""
    method = integrators[name]
    if method.requires and not orbit.system.quadratic_kinetic_energy:
        return inf
    taus = [method.stages * tau_per_stage * share for share in AROUND]
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # steps are those that fit into the interval
        if not orbit.start:
            return float(np.median(sweep(orbit.system, name, taus, t_end=t_end).max_energy_error))
        runs = [integrate(orbit.system, name, tau, t_end=t_end, samples=2, **orbit.start) for tau in taus]
        return float(np.median([float(run.max_energy_error) for run in runs]))


if __name__ == "__main__":
    fill(__doc__, parts, PAGE, PICTURE)
