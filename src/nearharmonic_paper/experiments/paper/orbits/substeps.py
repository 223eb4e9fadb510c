"""The substeps of a step in phase space, and the Hamiltonian around them (Nielsen 2015, Eqs. 3, 4 and Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.integrators import nielsen_2015, yoshida_1990
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import System, henon_heiles, sho

if TYPE_CHECKING:
    import xarray as xr

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
