"""Long orbits and substeps: Lyapunov exponents, the panels of Figure 6, and advances of the perihelion."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import zip_longest
from math import sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from contourpy import contour_generator

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import start_array
from nearharmonic.engine.settings import Numerics, tau_grid
from nearharmonic.engine.tangent import tangent_system
from nearharmonic.engine.trajectory import Problem
from nearharmonic.integrators import integrators, nielsen_2015, yoshida_1990
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import log
from nearharmonic.numerics.portable import Bools, Floats, dot, mean, student_975
from nearharmonic.output.store import Contents, Variables, coordinate, double_runs, variable
from nearharmonic.output.table import short
from nearharmonic.plotting.profile import Line, lines
from nearharmonic.systems import System, henon_heiles, sho
from nearharmonic.systems.quantities import Vector

if TYPE_CHECKING:
    import xarray as xr


# --- Largest Lyapunov exponents of the Henon-Heiles system: of the paper's orbit, and of a regular one for contrast.

#: Initial q and p, decimal strings.
Orbit = tuple[tuple[str, ...], tuple[str, ...]]
#: Orbit -> initial q and p: the paper's (Nielsen 2015, Eq. 18), H = 1/8, and a quarter of it, H = 1/128.
ORBITS: dict[str, Orbit] = {
    "paper": (henon_heiles.SYSTEM.q0, henon_heiles.SYSTEM.p0),
    "regular": (("0.075", "0"), ("0", "0.1")),
}
#: Step size: the energy error of BAB's8o7H on the paper's orbit stays below 1e-7.
TAU = 0.5
#: Time between two rescalings: deviations grow at most by e^50.
SCALED_EVERY = 500
#: Blocks of equal length for the interval. For t = 2e5 their length is 2e4, long compared with the times that the orbit
#: stays near regular orbits. In a test with fifty such parts of a longer run, 45 intervals contained the exponent of
#: the whole run.
BLOCKS = 10


def chaos(integrator: str, t_end: int) -> dict[str, Contents]:
    """Return the contents of the file ``cube``: :func:`lyapunov_exponents` of the Henon-Heiles system.

    The last time ``t_end`` is a multiple of ten times :data:`SCALED_EVERY`.
    """
    system, tableau, scalings = henon_heiles.SYSTEM, integrators[integrator], t_end // SCALED_EVERY
    problem = Problem(tangent_system(system), tableau, t_end=SCALED_EVERY, energy="none")
    variables = lyapunov_exponents(system, problem, scalings)
    attributes = {
        "system": system.name, "system_label": system.label, "integrator": tableau.name, "label": tableau.label,
        "tau": TAU, "blocks": BLOCKS,
    }  # fmt: skip
    evaluations = len(ORBITS) * scalings * tableau.evaluations(problem.steps_of(TAU))
    return {"cube": Contents(variables=variables, attributes=attributes, evaluations=evaluations)}


def lyapunov_exponents(system: System, problem: Problem, scalings: int) -> Variables:
    """Integrate each of :data:`ORBITS` with a deviation from it; the variables are over orbit and time.

    A call of ``problem`` is a run of the tangent system of ``system``, which has no parameters, over the time between
    two rescalings. Their number is a multiple of :data:`BLOCKS`.
    """
    every, units = float(problem.end), system.units
    time, rate = every * np.arange(1.0, scalings + 1), "1" if units["t"] == "1" else f"1/{units['t']}"
    followed = [follow(problem, TAU, orbit, scalings) for orbit in ORBITS.values()]
    states, growth = (np.array(column) for column in zip(*followed, strict=True))
    starts = np.array([[[float(x) for x in half] for half in orbit] for orbit in ORBITS.values()])
    initial = system.energy(*map(tuple, starts.transpose(1, 2, 0)))
    energy = system.energy(*map(tuple, states.transpose(2, 3, 0, 1)))
    interval = []
    for of_orbit in growth:
        rates = np.array([mean(block) for block in np.split(of_orbit, BLOCKS)]) / every
        spread = rates - mean(rates)
        interval.append(student_975(BLOCKS - 1) * sqrt(dot(spread, spread) / (BLOCKS - 1) / BLOCKS))
    exponent = "largest Lyapunov exponent up to the time, ln|delta(t)|/t of a deviation delta of length 1 at t = 0"
    width = "half width of the 95 % interval of the largest Lyapunov exponent up to the last time, by blocks of time"
    along, over = ("orbit", "component"), ("orbit", "time")
    return {
        **coordinate("orbit", list(ORBITS), "orbit"),
        **coordinate("time", time, "time", units["t"]),
        "q0": variable(along, starts[:, 0], "initial position", units["q"]),
        "p0": variable(along, starts[:, 1], "initial momentum", units["p"]),
        "initial_energy": variable("orbit", initial, "initial energy H0", units["energy"]),
        "energy_error": variable(over, (energy - initial[:, None]) / abs(initial[:, None]), "(H - H0)/|H0|"),
        "lyapunov_exponent": variable(over, np.cumsum(growth, axis=1) / time, exponent, rate),
        "lyapunov_exponent_interval": variable("orbit", interval, width, rate),
    }


def follow(problem: Problem, tau: float, orbit: tuple[Vector, Vector], runs: int) -> tuple[Floats, Floats]:
    """Chain n runs of a tangent system; the deviation is rescaled to length 1 after each run to avoid overflow.

    A call of ``problem`` is a run of a tangent system of d coordinates, without energy, over the time between two
    rescalings; the next begins with the doubles where it ends, without the carries, which :func:`nearharmonic.tangent`
    keeps. ``orbit`` is the initial q and p; the tangent system has the initial deviation. Returned are q and p at the
    end of each run (n, 2, d), and the logarithms of the factors by which the deviation grows (n,).
    """
    d = problem.system.dimension // 2
    u: Vector = problem.system.q0[d:]
    w: Vector = problem.system.p0[:d]
    q, p = orbit
    states, growth = np.empty((runs, 2, d)), np.empty(runs)
    for i in range(runs):
        end = problem(tau, (*q, *u), (*w, *p))
        q, u, w, p = (tuple(half) for row in (end.q[-1], end.p[-1]) for half in np.split(row, 2))
        length = sqrt(dot(u, u) + dot(w, w))
        states[i], growth[i] = (q, p), log(length)
        u, w = (tuple(x / length for x in half) for half in (u, w))
    return states, growth


# --- The substeps of a step in phase space, and the Hamiltonian around them (Nielsen 2015, Eqs. 3, 4 and Fig. 6).

State = tuple[float, float]
#: (lowest, highest) q and (lowest, highest) p of the grid of the Hamiltonian.
Window = tuple[State, State]

#: Points per axis of that grid: contours look smooth in print.
GRID = 81
#: Number of further iterations of a path, to check that it stays on its energy surface.
FOLLOWED = 1000

_OSCILLATOR = {"system": sho.SYSTEM, "start": (0.0, 1.0), "tau": math.pi / 4, "window": ((-0.1, 1.2), (-0.4, 1.2))}
_Y_PLANE = {"system": henon_heiles.SYSTEM, "start": (0.4, 0.4), "tau": 2.0, "window": ((0.0, 1.0), (-0.8, 0.6))}
#: Panel letter -> integrator, system, start and step size (Nielsen 2015, caption of Fig. 6); one window per system.
PAPER_PANELS: dict[str, tuple[str, dict[str, Any]]] = {
    "A": ("yoshida_s7o6a", _OSCILLATOR),
    "B": ("babs7o7h", _OSCILLATOR),
    "C": ("yoshida_s7o6a", _Y_PLANE | {"component": 1}),
    "D": ("babs7o7h", _Y_PLANE | {"component": 1}),
}


def paper_panels() -> dict[str, xr.Dataset]:
    """Return the Datasets of :func:`substeps` for the four panels of Fig. 6, by letter: two iterations each."""
    tableaus = {one.name: one for one in (*yoshida_1990.TABLEAUS, *nielsen_2015.TABLEAUS)}
    return {letter: substeps(tableaus[name], **settings) for letter, (name, settings) in PAPER_PANELS.items()}


def substeps(
    tableau: Tableau, system: System, *, start: State, tau: float, window: Window, iterations: int = 2,
    component: int = 0,
) -> xr.Dataset:  # fmt: skip
    """Return all substeps of some steps in doubles, for one degree of freedom, and the Hamiltonian around them.

    ``start`` is q and p of the moving coordinate, whose index is ``component``; the others are zero and stay zero.
    ``window`` is the part of the phase plane for the Hamiltonian. ``max_energy_error`` is over :data:`FOLLOWED`
    iterations, inf if the path diverges, and ``left_at`` the iteration at which it diverges, else 0.

    q, p, H and ``energy_error`` (relative to the start, signed) over (iteration, substep): substep 0 is the initial and
    substep s + 1 the final position, and substep i the state after the i-th pair of drift and kick; a zero completes
    the shorter row. Over substep: ``kind`` ("initial", "substep", "final") and ``next_drift_sign``, ``next_kick_sign``,
    the signs (-1, 0, 1) of pair i + 1, 0 also where no pair follows. Over (p_grid, q_grid): ``hamiltonian``.
    """
    import xarray as xr

    plane = _Plane(tableau, system, component, tau)
    path = [plane.walk(start)]
    while len(path) < iterations:
        path.append(plane.walk(path[-1][-1]))
    q, p = np.moveaxis(np.array(path), -1, 0)
    q_grid, p_grid = (np.linspace(low, high, GRID) for low, high in window)
    with np.errstate(over="ignore", invalid="ignore"):  # a path may go to infinity
        energy = plane.hamiltonian(q, p)
        around = plane.hamiltonian(q_grid[None, :], p_grid[:, None])
        error = (energy - energy[0, 0]) / abs(energy[0, 0])
    drifts, kicks = np.sign(np.array([*plane.pairs, (0.0, 0.0)])).astype(np.int8).T
    largest, left_at = plane.follow(start)
    units, along = system.units, ("iteration", "substep")
    return xr.Dataset(
        {
            "q": (along, q, {"units": units["q"], "long_name": "position"}),
            "p": (along, p, {"units": units["p"], "long_name": "momentum"}),
            "H": (along, energy, {"units": units["energy"], "long_name": "Hamiltonian"}),
            "energy_error": (along, error, {"units": "1"}),
            "next_drift_sign": ("substep", drifts, {"units": "1"}),
            "next_kick_sign": ("substep", kicks, {"units": "1"}),
            "kind": ("substep", ["initial", *["substep"] * (len(drifts) - 2), "final"]),
            "hamiltonian": (("p_grid", "q_grid"), around, {"units": units["energy"]}),
            "max_energy_error": ((), largest, {"units": "1"}),
            "left_at": ((), left_at, {"units": "1"}),
        },
        coords={
            "iteration": ("iteration", np.arange(1, iterations + 1)),
            "substep": ("substep", np.arange(len(drifts))),
            "q_grid": ("q_grid", q_grid, {"units": units["q"], "long_name": "position"}),
            "p_grid": ("p_grid", p_grid, {"units": units["p"], "long_name": "momentum"}),
        },
        attrs={
            "integrator": tableau.name, "label": tableau.label, "first": tableau.first, "system": system.name,
            "system_label": system.label, "component": component, "tau": tau, "followed": FOLLOWED,
        },
    )  # fmt: skip


class _Plane:
    """Steps of a method on a system with all coordinates except one at rest at zero."""

    def __init__(self, tableau: Tableau, system: System, component: int, tau: float) -> None:
        self._system, self._component, self._tau, self._grad_T = system, component, tau, system.formulas().grad_T
        self._before, self._behind = [0.0] * component, [0.0] * (system.dimension - component - 1)
        self._parameters, self._drift_first = system.constants(float), tableau.first == "drift"
        self.pairs = list(zip_longest(map(float, tableau.drift), map(float, tableau.kick), fillvalue=0.0))

    def _embed(self, value: Any) -> tuple[Any, ...]:
        return (*self._before, value, *self._behind)

    def hamiltonian(self, q: Any, p: Any) -> Any:
        return self._system.energy(self._embed(q), self._embed(p), self._parameters)

    def walk(self, start: State) -> list[State]:
        """Return ``start`` and the state after each (drift, kick) pair: Eq. 3 if drifts are first, else Eq. 4."""
        (q, p), points, component = start, [start], self._component
        for drift, kick in self.pairs:
            for moves_q in (self._drift_first, not self._drift_first):
                if moves_q:
                    q += self._tau * drift * float(self._grad_T(self._embed(p), *self._parameters)[component])
                else:
                    p -= self._tau * kick * float(self._system.grad_V(self._embed(q), *self._parameters)[component])
            points.append((q, p))
        return points

    def follow(self, start: State) -> tuple[float, int]:
        """Return the largest |dH/H0| over FOLLOWED iterations and 0, or inf and the iteration of divergence."""
        reference, state, largest = self.hamiltonian(*start), start, 0.0
        for iteration in range(1, FOLLOWED + 1):
            state = self.walk(state)[-1]
            error = abs(self.hamiltonian(*state) - reference) / abs(reference)
            if not error <= self._system.surface_limit:  # true for NaN too
                return math.inf, iteration
            largest = max(largest, error)
        return largest, 0


# --- Panel D of Figure 6 from starts outside the plane q_x = 0: there the paths finally diverge.

#: Initial q_x.
DISPLACEMENTS = ("0", "1e-12", "1e-6", "1e-3", "1e-2")
SUMS = ("compensated", "plain")
#: Samples per decade of the iterations.
PER_DECADE = 24


def displaced(integrator: str, iterations: int) -> dict[str, Contents]:
    """Integrate panel D with each of :data:`DISPLACEMENTS` in place of q_x = 0, with both summations.

    The ``cube`` has over (displacement, summation) ``left_at`` and ``max_energy_error``, and over iterations evenly
    spaced in the logarithm ``block_max_energy_error`` and ``q_x``, NaN once the path has left its energy surface.
    """
    tableau, (_, panel) = integrators[integrator], PAPER_PANELS["D"]
    system = panel["system"]
    samples = {round(n) for n in tau_grid(1, iterations, PER_DECADE)} | {iterations}
    marks = np.array([0, *sorted(samples)])
    (q_y, p_y), runs, paths = map(str, panel["start"]), len(DISPLACEMENTS), []
    for summation in SUMS:
        starts = [start_array(system, (q_x, q_y), ("0", p_y), plain=summation == "plain") for q_x in DISPLACEMENTS]
        paths.append(
            integrate_batch(
                system, tableau, t_end=Fraction(panel["tau"]) * iterations, steps=[iterations] * runs, samples=2,
                numerics=Numerics(summation=summation), start=np.concatenate(starts), marks=np.tile(marks, (runs, 1)),
            )
        )  # fmt: skip
    columns = ("left_at", "max_energy_error", "block_max", "q")
    left_at, largest, blocks, q = (np.stack([getattr(path, key) for path in paths], axis=1) for key in columns)
    over, unit = ("displacement", "summation"), system.units["q"]
    along, since = (*over, "iteration"), "maximum of |H - H0|/|H0| since the previous sample"
    variables = {
        **coordinate("displacement", np.array(DISPLACEMENTS, dtype=float), "initial q_x", unit),
        **coordinate("summation", SUMS, "summation of the steps"),
        **coordinate("iteration", marks[1:], "number of the iteration"),
        "left_at": variable(over, left_at, "iteration that left the energy surface, 0 if none did"),
        "max_energy_error": variable(over, largest, "maximum of |H - H0|/|H0| over every iteration, inf if one left"),
        "block_max_energy_error": variable(along, blocks[..., 1:], since),
        "q_x": variable(along, q[..., 1:, 0], "q_x", unit),
    }
    attributes = {
        "system": system.name, "system_label": system.label, "integrator": tableau.name, "label": tableau.label,
        "tau": panel["tau"], "iterations": iterations, "surface_limit": system.surface_limit,
    }  # fmt: skip
    evaluations = sum(tableau.evaluations(n or iterations) for n in left_at.ravel().tolist())
    return {"cube": Contents(variables=variables, attributes=attributes, evaluations=evaluations)}


# --- Content of Figures 2, 4 and 6, on paper and in a browser, without matplotlib.

#: An error term below this level is zero to the digits of the coefficients; terms of fewer digits are exactly 0.
SATISFIED_BELOW = 1e-30
#: Arcseconds per century, from general relativity: Nobili & Will (1986), doi:10.1038/320039a0.
MERCURY_RELATIVISTIC_ADVANCE = 42.98
#: Ranges of advances in rad per orbit in which curves do not have their order.
NO_ORDER = (("far from an ellipse", 0.1, math.inf), ("rounding errors", 0.0, 1e-15))


def statement(panel: xr.Dataset) -> list[str]:
    """Return the step size and the energy error of a panel of :func:`substeps`, and its error later, in words."""
    error, largest = abs(float(panel["energy_error"].values[-1, -1])), float(panel["max_energy_error"])
    tau, left_at, part = panel.attrs["tau"], int(panel["left_at"]), math.pi / panel.attrs["tau"]
    after = f"{short(error, 2) if math.isfinite(error) else '∞'} after {panel.sizes['iteration']} iterations,"
    later = f"at most {short(largest, 2)} in {panel.attrs['followed']} iterations"
    return [
        f"τ = {f'π/{part:.0f}' if part.is_integer() else f'{tau:.4g}'}, |ΔH/H₀| = {after}",
        f"leaves its energy surface at iteration {left_at}" if left_at else later,
    ]


def legs(panel: xr.Dataset) -> Floats:
    """Return the paths (iteration, point, q or p) of a panel with their corners: drifts move q, kicks move p."""
    q, p = (np.repeat(panel[name].values, 2, axis=1) for name in "qp")
    drift_first = panel.attrs["first"] == "drift"
    return np.stack([q[:, 1:], p[:, :-1]] if drift_first else [q[:, :-1], p[:, 1:]], axis=-1)


def levels(panel: xr.Dataset) -> Floats:
    """Return at most fourteen round, evenly spaced levels that enclose the Hamiltonian of a panel."""
    H = panel["hamiltonian"].values
    low, high = (H.min(), H.max()) if np.isfinite(H).all() else (0.0, 1.0)
    unit = 10.0 ** math.floor(math.log10((high - low) / 12))
    step = next(n * unit for n in (1, 1.5, 2, 2.5, 3, 4, 5, 10) if 12 * n * unit >= high - low)
    return step * np.arange(math.floor(low / step), math.ceil(high / step) + 1)


def contours(panel: xr.Dataset, level: float) -> list[Any]:
    """Return the contours (point, q or p) of the Hamiltonian of a panel at ``level``."""
    return list(contour_generator(*(panel[name].values for name in ("q_grid", "p_grid", "hamiltonian"))).lines(level))


def label_places(panel: xr.Dataset) -> dict[str, State]:
    """Return text and place (q, p) of the labels: numbers in the first iteration, H on three contours; none overlap."""
    low, high = (np.array([panel[name].values[i] for name in ("q_grid", "p_grid")]) for i in (0, -1))
    way, angles = (legs(panel) - low) / (high - low), np.arange(16) * math.pi / 8
    ring = np.concatenate([away * np.stack([np.cos(angles), np.sin(angles)], axis=-1) for away in (0.045, 0.067)])
    candidates = {str(i): dot + ring for i, dot in enumerate(way[0, 2:-1:2], start=1)}
    along = [(way[:, :-1] + part * np.diff(way, axis=1)).reshape(-1, 2) for part in np.linspace(0, 1, 20)]
    heights = [float(panel["H"][0, 0]), *levels(panel)[[1, -6, -4]]]
    lines = [(np.concatenate([np.empty((0, 2)), *contours(panel, H)]) - low) / (high - low) for H in heights]
    for H, line in zip(heights[1:], lines[1:], strict=True):
        candidates[f"H = {H:g}"] = line[(abs(line - 0.5) < 0.39).all(axis=1)]
    taken, places = np.concatenate([*along, lines[0]]), {}
    for text, around in candidates.items():
        if len(around):
            half, enough = (0.0, 0.03) if text.isdigit() else (0.09, 1.0)  # half the width; a number stays near its dot
            x, y = abs(around[:, None] - taken).T
            best = around[np.hypot((x - half).clip(min=0), y).min(axis=0).clip(max=enough).argmax()]
            taken, places[text] = np.vstack([taken, best]), tuple((low + best * (high - low)).tolist())
    return places


def arcseconds_per_century(orbital_period: float) -> float:
    """Return 1 rad per orbit in arcseconds per century, for a period in hours."""
    return (180 * 3600 / math.pi) * (36525 * 24) / orbital_period


class Advances(NamedTuple):
    """Perihelion advances of the runs of one method over tau_per_stage.

    ``size`` is positive, NaN where there is none to draw; ``interval`` is the half width of its 95 % interval, which
    excludes zero where the advance is ``known``, and includes it where it is ``unknown``.
    """

    line: Line
    evaluations: Floats
    size: Floats
    interval: Floats
    known: Bools
    unknown: Bools


def advances(cube: xr.Dataset, columns: int) -> list[Advances]:
    """Return the advances of each method of ``cube`` in double, as many as ``columns`` can show."""
    found = []
    for line in lines(double_runs(cube), ["perihelion_advance"], columns):
        size: Floats = np.abs(np.array(line.runs["perihelion_advance"].values, float))
        size[~(np.isfinite(size) & (size > 0))] = np.nan
        interval = np.array(line.runs["perihelion_advance_interval"].values, float)
        evaluations = line.runs["evaluations_per_orbit"].values
        found.append(Advances(line, evaluations, size, interval, interval < size, interval >= size))
    return found
