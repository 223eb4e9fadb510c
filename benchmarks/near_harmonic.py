"""Energy errors of all methods on the examples, beside a measure of how far their orbits are from harmonic.

Run: ``python benchmarks/near_harmonic.py`` (about two minutes). Writes the tables into docs/examples.md and draws
docs/near_harmonic.png. Nothing is timed: every machine finds the same.

The measure is the variation of the Hessian, delta = rms |W - mean W| / rms |W| along the orbit, where W is V'' between
coordinates that are scaled by the square roots of the masses, and |.| the Frobenius norm. It is 0 for every harmonic
system, whatever its frequencies and amplitudes, and at most 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, isnan, log, log10, nan, pi
from pathlib import Path

import numpy as np

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.output.page import filled, pipes
from nearharmonic.systems.user_file import load_system

ROOT = Path(__file__).parents[1]
PAGE, PICTURE = ROOT / "docs/examples.md", ROOT / "docs/near_harmonic.png"
#: The methods of the paper's figures: its own, and those that it compares them with.
NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
SIX = ("ruth", "s5odr4", "aba104", "aba864", "aba1064", "yoshida_s7o6a")
#: Every registered method of other authors; the rest of the paper's Table 4 and the methods found here are left out.
OWN = ("Nielsen", "found by", "trained by")
OTHERS = tuple(name for name in plain_integrators.registered if not nh.integrators[name].source.startswith(OWN))
#: Evaluations of the force in the shortest period 2 pi / omega, omega^2 the largest |eigenvalue| of W on the orbit.
COSTS = (25, 50, 100)
#: A method's error is the median over these multiples of the step size, which no single resonance decides.
AROUND = (0.9, 0.95, 1.0, 1.05, 1.1)
#: Shortest periods that a run covers, if the system's own interval is not shorter; samples of the Hessian.
PERIODS, SAMPLES = 100, 257
#: Coordinates up to which W is formed; beyond, its norms are found from products with random vectors.
FORMED = 40
#: Bands of delta in the first table.
BANDS = (0, 0.01, 0.1, 0.5, 1.01)
#: Energy errors that are made of rounding alone.
ROUNDING = 1e-15
#: Frequencies of the drives where they are higher than the oscillator's.
DRIVES = {"paul_trap": 2.0, "driven_oscillator": 1.5}


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """A system from its own initial values, or from others; ``amplitude`` is how the second table names these."""

    system: nh.System
    family: str
    amplitude: str = ""
    start: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Result:
    """Measurements of an orbit: delta, omega, and the energy error of each method by cost and name."""

    orbit: Orbit
    delta: float
    omega: float
    errors: dict[int, dict[str, float]]

    def best(self, cost, names):
        return min(names, key=self.errors[cost].__getitem__)

    def shown(self, cost, name):
        """Return the table's cell for the error of a method."""
        error = self.errors[cost][name]
        return "rounding" if error < ROUNDING else f"{error:.0e}" if error < 1 else "fails"

    def gain(self, cost, names):
        """Decades by which the best of NEW is better than the best of ``names``; NaN where one fails or only rounds."""
        new, other = (self.errors[cost][self.best(cost, group)] for group in (NEW, names))
        return log10(other / new) if max(new, other) < 1 and min(new, other) > ROUNDING else nan


def example(name):
    return load_system(ROOT / "examples" / f"{name}.py")


def examples():
    """Each system of the examples whose V is an expression, from which a Hessian is derived."""
    paths = sorted((ROOT / "examples").glob("*.py"))
    found = [Orbit(system=load_system(path), family=path.stem) for path in paths if "SYSTEM =" in path.read_text()]
    return [orbit for orbit in found if orbit.system.energies[0].traced]


def families():
    """Orbits of systems from small amplitudes to large ones."""
    for a in (0.05, 0.1, 0.2, 0.5, 1, 1.5, 2, 2.5, 3):
        yield Orbit(system=example("pendulum"), family="pendulum", amplitude=f"{a} rad", start={"q0": [a]})
    for e in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.9):
        start = {"q0": [-log(1 - e)]}
        yield Orbit(system=example("morse"), family="Morse oscillator", amplitude=f"H = {e * e:.2g} D", start=start)
    for a in (0.02, 0.05, 0.1, 0.2, 0.4, 1):
        start = {"q0": [0.3 * a, 0.2 * a], "p0": [0.3 * a, -0.2 * a]}
        label = f"H = {nh.systems['henon_heiles'].energy(*start.values()):.2g}"
        yield Orbit(system=nh.systems["henon_heiles"], family="Hénon-Heiles", amplitude=label, start=start)
    for name, scales in (("quartic_well", (0.05, 0.1, 0.3, 1, 3)), ("toda_chain", (0.05, 0.2, 0.5, 1, 2)),
                         ("fput_recurrence", (0.1, 0.3, 1, 3, 6))):  # fmt: skip
        system = example(name)
        q0, p0 = system.start(float)
        for a in scales:
            start = {"q0": [a * x for x in q0], "p0": [a * x for x in p0]}
            yield Orbit(system=system, family=system.label, amplitude=f"{a} × the example's", start=start)


class Hessian:
    """W = M^(-1/2) V'' M^(-1/2) along an orbit, as a linear map: positions and times (n, d) or (n, d + 1)."""

    def __init__(self, system, run):
        self.formulas, self.parameters, d = system.formulas(), system.constants(float), system.dimension
        times = [run.t.values] if system.time_dependent else []
        self.places = (*run.q.values.T, *times)
        rows = np.eye(self.formulas.dimension)[:d]
        of_T = [self.formulas.hessian_T_times(rows[0], row, *self.parameters)[i] for i, row in enumerate(rows)]
        self.scales = np.sqrt(np.array(of_T, float))  # masses are diagonal in all examples

    def times(self, x):
        """W at each place times the rows of x, (n, d) or one row for all."""
        x = np.broadcast_to(x * self.scales, (len(self.places[0]), len(self.scales)))
        more = [np.zeros(len(x))] * (len(self.places) - len(self.scales))
        product = self.formulas.hessian_V_times(self.places, (*x.T, *more), *self.parameters)
        return np.stack([np.broadcast_to(row, len(x)) for row in product[: len(self.scales)]], axis=-1) * self.scales


def variation(orbit, tau, t_end):
    """delta and omega of an orbit, from a run with step size ``tau``, which need only be fine enough to follow it."""
    d = orbit.system.dimension
    samples = SAMPLES if d <= FORMED else 9
    run = nh.integrate(orbit.system, "s15odr8", tau, t_end=t_end, samples=samples, energy="none", **orbit.start)
    hessian = Hessian(orbit.system, run)
    random = np.random.default_rng(1)
    probes = np.eye(d) if d <= FORMED else random.choice([-1.0, 1.0], (16, d))
    columns = np.stack([hessian.times(probe) for probe in probes])
    delta = np.sqrt(((columns - columns.mean(axis=1, keepdims=True)) ** 2).sum() / (columns**2).sum())
    x = random.normal(size=(len(run.t), d))
    for _ in range(100 if d <= FORMED else 30):  # the power method at each sample
        x = hessian.times(x / np.linalg.norm(x, axis=-1, keepdims=True))
    return float(delta), float(f"{np.sqrt(np.linalg.norm(x, axis=-1).max()):.3g}")


def measured(orbit):
    """Everything about an orbit."""
    system, whole = orbit.system, float(orbit.system.t_end)
    steps = 20000 if system.dimension <= FORMED else 2000
    _, omega = variation(orbit, whole / steps, whole)
    t_end = min(whole, PERIODS * 2 * pi / omega)
    delta, omega = variation(orbit, t_end / steps, t_end)
    omega = max(omega, DRIVES.get(system.name, 0))
    errors = {}
    for cost in COSTS:
        each = 2 * pi / omega / cost
        errors[cost] = {name: error(orbit, name, each, t_end) for name in (*NEW, *OTHERS)}
    return Result(orbit=orbit, delta=delta, omega=omega, errors=errors)


def error(orbit, name, tau_per_stage, t_end):
    """The median over AROUND of the largest energy error of a method."""
    method = nh.integrators[name]
    if method.requires and not orbit.system.quadratic_kinetic_energy:
        return inf
    taus = [method.stages * tau_per_stage * share for share in AROUND]
    if not orbit.start:
        return float(np.median(nh.sweep(orbit.system, name, taus, t_end=t_end).max_energy_error))
    runs = [nh.integrate(orbit.system, name, tau, t_end=t_end, samples=2, **orbit.start) for tau in taus]
    return float(np.median([float(run.max_energy_error) for run in runs]))


def decades(gain):
    return "" if isnan(gain) else f"{gain:+.1f}".replace("-", "\N{MINUS SIGN}")


def table(header, rows):
    return "\n".join(pipes(header, rows, align="llr"))


def table_of_examples(results):
    header = ("example", "forces", "δ", "best of the ten", "error", "best of other authors", "error",
              "gain over the six", "gain over all")  # fmt: skip
    rows = []
    for result in sorted(results, key=lambda one: one.delta):
        for cost in COSTS:
            ten, other = (result.best(cost, names) for names in (NEW + SIX, OTHERS))
            named = [text for name in (ten, other) for text in (nh.integrators[name].label, result.shown(cost, name))]
            first = cost == COSTS[0]
            file = f"[{result.orbit.family}](../examples/{result.orbit.family}.py)" if first else ""
            gains = [decades(result.gain(cost, names)) for names in (SIX, OTHERS)]
            rows.append((file, cost, f"{result.delta:.2g}" if first else "", *named, *gains))
    return table(header, rows)


def table_of_families(results):
    header = ("orbit", "amplitude", "δ", *(f"over the six, {cost}" for cost in COSTS),
              *(f"over all, {cost}" for cost in COSTS))  # fmt: skip
    rows = []
    for i, result in enumerate(results):
        new = i == 0 or results[i - 1].orbit.family != result.orbit.family
        gains = [decades(result.gain(cost, names)) for names in (SIX, OTHERS) for cost in COSTS]
        rows.append((result.orbit.family if new else "", result.orbit.amplitude, f"{result.delta:.2g}", *gains))
    return table(header, rows)


def table_of_bands(results):
    """Least, median and largest gain of the orbits whose delta is in a band."""
    header = ("δ", "compared with", *(f"{cost} forces" for cost in COSTS))
    rows = []
    for low, high in pairwise(BANDS):
        inside = [one for one in results if low <= one.delta < high]
        for names, says in ((SIX, "the other six"), (OTHERS, "all others")):
            cells = []
            for cost in COSTS:
                gains = [gain for one in inside if not isnan(gain := one.gain(cost, names))]
                low_gain, middle, high_gain = (decades(float(f(gains))) for f in (min, np.median, max))
                cells.append(f"{low_gain} / **{middle}** / {high_gain}")
            rows.append((f"{low:g} to {high:g} ({len(inside)} orbits)" if names is SIX else "", says, *cells))
    return table(header, rows)


def draw(results, place):
    """Gain against delta at the middle cost, a marker for each family, the other examples as dots."""
    import matplotlib as mpl

    from nearharmonic.plotting.style import SETTINGS, new_figure, panel_letter, save

    mpl.rcParams.update(SETTINGS)
    figure = new_figure(7, 6.4)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.88, bottom=0.08, hspace=0.15)
    panels = figure.subplots(2, 1, sharex=True)
    looks = iter(zip("osD^vP", ("#0b3c8c", "#e86a10", "#00a070", "#8e3fb5", "#8b0000", "#4a90e2"), strict=True))
    seen = {}
    for result in results:
        family = result.orbit.family if result.orbit.amplitude else "other examples"
        if family not in seen:
            marker, colour = next(looks) if result.orbit.amplitude else ("x", "#595959")
            seen[family] = {"marker": marker, "color": colour, "linestyle": "none"}
        for axes, names in zip(panels, (SIX, OTHERS), strict=True):
            axes.plot(result.delta, result.gain(COSTS[1], names), **seen[family])
    compared = ("the other six of the paper", "all methods of other authors")
    for axes, letter, says in zip(panels, "AB", compared, strict=True):
        axes.axhline(0, color="#404040", linewidth=0.8)
        axes.set(xscale="log", xlim=(1e-4, 1.3), ylabel="gain (decades)")
        panel_letter(axes, letter, f"over {says}, {COSTS[1]} forces in the shortest period")
    panels[1].set_xlabel(r"variation of the Hessian along the orbit, $\delta$")
    handles = [mpl.lines.Line2D([], [], label=family, **look) for family, look in seen.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.54, 1), ncols=4)
    save(figure, [place])


def tables():
    """The text between the marks of the page, and every result."""
    of_examples = [measured(orbit) for orbit in examples()]
    of_families = [measured(orbit) for orbit in families()]
    twice = {one.orbit.system.name for one in of_families}
    others = [one for one in of_examples if one.orbit.system.name not in twice]
    results = [*of_families, *others]
    parts = {"bands": table_of_bands(results), "examples": table_of_examples(of_examples)}
    return parts | {"families": table_of_families(of_families)}, results


if __name__ == "__main__":
    found, results = tables()
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
    draw(results, PICTURE)
    print(f"wrote {PAGE} and {PICTURE}")
