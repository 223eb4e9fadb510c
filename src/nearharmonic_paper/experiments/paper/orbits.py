"""Long orbits and substeps: Lyapunov exponents, and the panels of Figure 6."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import zip_longest
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.numbers import start_array
from nearharmonic.engine.settings import Numerics, tau_grid
from nearharmonic.engine.solution import Problem
from nearharmonic.engine.variation import tangent_system
from nearharmonic.integrators import integrators, nielsen_2015, yoshida_1990
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, dot, mean, student_975
from nearharmonic.output.dataset import Contents, Variables, coordinate, variable
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

#: Variables over orbit: their further dimensions, their meaning, and the quantity that determines their unit.
MEANINGS = {
    "q0": (("component",), "initial position", "q"),
    "p0": (("component",), "initial momentum", "p"),
    "initial_energy": ((), "initial energy H0", "energy"),
    "energy_error": (("time",), "(H - H0)/|H0|", "1"),
    "lyapunov_exponent": (
        ("time",),
        "largest Lyapunov exponent up to the time, ln|delta(t)|/t of a deviation delta of length 1 at t = 0",
        "1/t",
    ),
    "lyapunov_exponent_interval": (
        (),
        "half width of the 95 % interval of the largest Lyapunov exponent up to the last time, by blocks of time",
        "1/t",
    ),
}


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
    """Integrate each of :data:`ORBITS` with a deviation from it; the variables are those of :data:`MEANINGS`.

    A call of ``problem`` is a run of the tangent system of ``system``, which has no parameters, over the time between
    two rescalings. Their number is a multiple of :data:`BLOCKS`.
    """
    every, unit = float(problem.end), system.units["t"]
    time = every * np.arange(1.0, scalings + 1)
    found = [_of_orbit(system, problem, orbit, time) for orbit in ORBITS.values()]
    units = {**system.units, "1": "1", "1/t": "1" if unit == "1" else f"1/{unit}"}
    return {
        **coordinate("orbit", list(ORBITS), "orbit"),
        **coordinate("time", time, "time", unit),
        **{
            name: variable(("orbit", *dims), np.array([one[name] for one in found]), text, units[key])
            for name, (dims, text, key) in MEANINGS.items()
        },
    }


def _of_orbit(system: System, problem: Problem, orbit: Orbit, time: Floats) -> dict[str, object]:
    """Return the variables of one orbit."""
    q0, p0 = (tuple(map(float, values)) for values in orbit)
    states, growth = follow(problem, TAU, orbit, time.size)
    q, p = (tuple(rows) for rows in states.transpose(1, 2, 0))
    start, energy = system.energy(q0, p0), system.energy(q, p)
    rates = np.array([mean(block) for block in np.split(growth, BLOCKS)]) / float(problem.end)
    spread = rates - mean(rates)
    return {
        "q0": q0,
        "p0": p0,
        "initial_energy": start,
        "energy_error": (energy - start) / abs(start),
        "lyapunov_exponent": np.cumsum(growth) / time,
        "lyapunov_exponent_interval": student_975(BLOCKS - 1) * sqrt(dot(spread, spread) / (BLOCKS - 1) / BLOCKS),
    }


def follow(problem: Problem, tau: float, orbit: tuple[Vector, Vector], runs: int) -> tuple[Floats, Floats]:
    """Chain n runs of a tangent system; the deviation is rescaled to length 1 after each run to avoid overflow.

    A call of ``problem`` is a run of a tangent system of d coordinates, without energy, over the time between two
    rescalings; the next begins with the doubles where it ends, without the carries. The files of the paper's orbit have
    these bits, which :func:`nearharmonic.tangent` does not repeat: it keeps the carries of the orbit. ``orbit`` is
    the initial q and p; the initial deviation is that of the tangent system. Returned are q and p at the end of each
    run (n, 2, d), and the logarithms of the factors by which the deviation grows (n,).
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

Array = np.ndarray[Any, np.dtype[Any]]
State = tuple[float, float]
#: (lowest, highest) q and (lowest, highest) p of the grid of the Hamiltonian.
Window = tuple[State, State]

#: Points per axis of that grid: contours look smooth in print.
GRID = 161
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
    panels = {}
    for letter, (name, settings) in PAPER_PANELS.items():
        (tableau,) = (one for one in (*yoshida_1990.TABLEAUS, *nielsen_2015.TABLEAUS) if one.name == name)
        panels[letter] = substeps(tableau, iterations=2, **settings)
    return panels


def substeps(
    tableau: Tableau,
    system: System,
    *,
    start: State,
    tau: float,
    window: Window,
    iterations: int = 2,
    component: int = 0,
) -> xr.Dataset:
    """Return all substeps of some steps in doubles, for one degree of freedom: the dataset of :func:`_dataset`.

    ``start`` is q and p of the moving coordinate, whose index is ``component``; the others are zero and stay zero.
    ``window`` is the part of the phase plane for the Hamiltonian. ``max_energy_error`` is over :data:`FOLLOWED`
    iterations, inf if the path diverges, and ``left_at`` the iteration at which it diverges, else 0.
    """
    plane = _Plane(system, component)
    pairs = list(zip_longest(map(float, tableau.drift), map(float, tableau.kick), fillvalue=0.0))
    walk = partial(_walk, pairs=pairs, plane=plane, tau=tau, drift_first=tableau.first == "drift")
    path = [walk(start)]
    while len(path) < iterations:
        path.append(walk(path[-1][-1]))
    points = np.array(path)
    q, p = points[..., 0], points[..., 1]
    q_grid, p_grid = (np.linspace(low, high, GRID) for low, high in window)
    with np.errstate(over="ignore", invalid="ignore"):  # a path may go to infinity
        energy = plane.hamiltonian(q, p)
        around = plane.hamiltonian(q_grid[None, :], p_grid[:, None])
        error = (energy - energy[0, 0]) / abs(energy[0, 0])
    signs = np.sign(np.array([*pairs, (0.0, 0.0)])).astype(np.int8)
    found = _dataset(system.units, (q, p, energy, error), signs, (q_grid, p_grid, around))
    largest, left_at = _follow(walk, start, plane, system.surface_limit)
    found["max_energy_error"] = ((), largest, {"units": "1"})
    found["left_at"] = ((), left_at, {"units": "1"})
    names = {"integrator": tableau.name, "label": tableau.label, "first": tableau.first}
    told = {"system": system.name, "system_label": system.label, "component": component}
    return found.assign_attrs(names | told | {"tau": tau, "followed": FOLLOWED})


def _dataset(units: Mapping[str, str], path: Sequence[Array], signs: Array, around: Sequence[Array]) -> xr.Dataset:
    """Return the drawn data: q, p, H and its error along the ``path``, and H on a grid ``around`` it.

    q, p, H and ``energy_error`` (relative to the start, signed) over (iteration, substep): substep 0 is the initial and
    substep s + 1 the final position, and substep i the state after the i-th pair of drift and kick; a zero completes
    the shorter row. Over substep: ``kind`` ("initial", "substep", "final") and ``next_drift_sign``, ``next_kick_sign``,
    the signs (-1, 0, 1) of pair i + 1, 0 also where no pair follows. Over (p_grid, q_grid): ``hamiltonian``.
    """
    import xarray as xr

    q, p, energy, error = path
    q_grid, p_grid, hamiltonian = around
    iterations, substeps = q.shape
    along = ("iteration", "substep")
    return xr.Dataset(
        {
            "q": (along, q, {"units": units["q"], "long_name": "position"}),
            "p": (along, p, {"units": units["p"], "long_name": "momentum"}),
            "H": (along, energy, {"units": units["energy"], "long_name": "Hamiltonian"}),
            "energy_error": (along, error, {"units": "1"}),
            "next_drift_sign": ("substep", signs[:, 0], {"units": "1"}),
            "next_kick_sign": ("substep", signs[:, 1], {"units": "1"}),
            "kind": ("substep", ["initial", *["substep"] * (substeps - 2), "final"]),
            "hamiltonian": (("p_grid", "q_grid"), hamiltonian, {"units": units["energy"]}),
        },
        coords={
            "iteration": ("iteration", np.arange(1, iterations + 1)),
            "substep": ("substep", np.arange(substeps)),
            "q_grid": ("q_grid", q_grid, {"units": units["q"], "long_name": "position"}),
            "p_grid": ("p_grid", p_grid, {"units": units["p"], "long_name": "momentum"}),
        },
    )


class _Plane:
    """A system with all coordinates except one at rest at zero."""

    def __init__(self, system: System, component: int) -> None:
        self._system, self._component = system, component
        self._parameters = system.constants(float)

    def _embed(self, value: Any) -> tuple[Any, ...]:
        return tuple(value if i == self._component else 0.0 for i in range(self._system.dimension))

    def hamiltonian(self, q: Any, p: Any) -> Any:
        return self._system.energy(self._embed(q), self._embed(p), self._parameters)

    def velocity(self, p: float) -> float:
        return float(self._system.formulas().grad_T(self._embed(p), *self._parameters)[self._component])

    def force(self, q: float) -> float:
        return -float(self._system.grad_V(self._embed(q), *self._parameters)[self._component])


def _walk(start: State, pairs: list[State], plane: _Plane, tau: float, *, drift_first: bool) -> list[State]:
    """Return ``start`` and the state after each (drift, kick) pair: Eq. 3 if ``drift_first``, else Eq. 4."""
    q, p = start
    points = [start]
    for drift, kick in pairs:
        if drift_first:
            q += tau * drift * plane.velocity(p)
            p += tau * kick * plane.force(q)
        else:
            p += tau * kick * plane.force(q)
            q += tau * drift * plane.velocity(p)
        points.append((q, p))
    return points


def _follow(walk: Callable[[State], list[State]], start: State, plane: _Plane, limit: float) -> tuple[float, int]:
    """Return the largest |dH/H0| over FOLLOWED iterations and 0, or inf and the iteration of divergence."""
    reference = plane.hamiltonian(*start)
    state, largest = start, 0.0
    for iteration in range(1, FOLLOWED + 1):
        state = walk(state)[-1]
        error = abs(plane.hamiltonian(*state) - reference) / abs(reference)
        if not error <= limit:  # true for NaN too
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
    paths = [_integrated(tableau, panel, summation, marks) for summation in SUMS]

    def of_runs(key: str) -> Any:
        return np.stack([getattr(path, key) for path in paths], axis=1)

    over, unit, left_at = ("displacement", "summation"), system.units["q"], of_runs("left_at")
    variables = {
        **coordinate("displacement", np.array(DISPLACEMENTS, dtype=float), "initial q_x", unit),
        **coordinate("summation", SUMS, "summation of the steps"),
        **coordinate("iteration", marks[1:], "number of the iteration"),
        "left_at": variable(over, left_at, "iteration that left the energy surface, 0 if none did"),
        "max_energy_error": variable(
            over, of_runs("max_energy_error"), "maximum of |H - H0|/|H0| over every iteration, inf if one left"
        ),
        "block_max_energy_error": variable(
            (*over, "iteration"), of_runs("block_max")[..., 1:], "maximum of |H - H0|/|H0| since the previous sample"
        ),
        "q_x": variable((*over, "iteration"), of_runs("q")[..., 1:, 0], "q_x", unit),
    }
    attributes = {
        "system": system.name, "system_label": system.label, "integrator": tableau.name, "label": tableau.label,
        "tau": panel["tau"], "iterations": iterations, "surface_limit": system.surface_limit,
    }  # fmt: skip
    evaluations = sum(tableau.evaluations(n or iterations) for n in left_at.ravel().tolist())
    return {"cube": Contents(variables=variables, attributes=attributes, evaluations=evaluations)}


def _integrated(tableau: Tableau, panel: dict[str, Any], summation: str, marks: np.ndarray[Any, Any]) -> Trajectories:
    """Return the runs with one summation, sampled at ``marks``; the last mark is the number of steps."""
    system, (q_y, p_y), runs = panel["system"], map(str, panel["start"]), len(DISPLACEMENTS)
    starts = [start_array(system, (q_x, q_y), ("0", p_y), plain=summation == "plain") for q_x in DISPLACEMENTS]
    steps = int(marks[-1])
    return integrate_batch(
        system, tableau, t_end=Fraction(panel["tau"]) * steps, steps=[steps] * runs, samples=2,
        numerics=Numerics(summation=summation), start=np.concatenate(starts), marks=np.tile(marks, (runs, 1)),
    )  # fmt: skip
