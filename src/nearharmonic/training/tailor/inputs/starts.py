"""Starts in a box around the orbit of the given one, on an energy surface, or from the user; half are for the test."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from nearharmonic.engine.batch.batch import integrate_batch
from nearharmonic.engine.batch.kernels import cost_of
from nearharmonic.engine.numbers.initial_values import start_array
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.training.tailor.inputs.start_file import FEWEST
from nearharmonic.training.tailor.orbit import METHOD, Orbit
from nearharmonic.training.tailor.question import Question

#: Half of the edge length of the box around a state of the orbit, in amplitudes of each coordinate.
HALF_EDGE = 0.1
#: Bounds of the number of starts: the cheaper the force, the more starts are drawn.
COST, MOST, LEAST = 512, 64, 16
#: Maximum number of draws, each with twice as many candidates as starts are needed.
DRAWS = 20
#: Largest energy error of a run with small steps; starts with larger errors (collision or escape) are omitted.
LARGEST_ERROR = 1e-2
#: Largest fraction of the way from the position of the lowest potential on the orbit to a state, if V is too high at
#: all states.
SHRINKING = np.linspace(1.0, 0.0, 41)[:-1]


def starts_of(asked: Question, orbit: Orbit, t_end: float, tau: float) -> tuple[Floats, Floats]:
    """Return starts (M, 4 D) for the search, and others for the test.

    Parameters
    ----------
    asked : Question
        System, energy, seed, and starts if they are given.
    orbit : Orbit
        States of the orbit from the initial values of the system.
    t_end : float
        Length of the runs in which all starts have to stay on their energy surface.
    tau : float
        Step size per stage of these runs, in the unit of time of the system.

    Raises
    ------
    SettingError
        Too few starts stay on their energy surface, or none has the requested energy.
    """
    random = np.random.default_rng([asked.seed, 1])
    if asked.starts is not None:
        d = asked.system.dimension
        rows = _rows(asked.system, asked.starts[:, :d], asked.starts[:, d:])
        fine = _stays(asked, rows, t_end, tau)
        if not fine.all():
            number = int(np.argmin(fine)) + 1
            raise SettingError(f"starts: the orbit of start {number} of {len(rows)} leaves its energy surface")
        order = random.permutation(len(rows))
    else:
        rows = _drawn(asked, orbit, t_end, tau, random)
        order = np.arange(len(rows))
    return rows[order[::2]], rows[order[1::2]]


def _drawn(asked: Question, orbit: Orbit, t_end: float, tau: float, random: np.random.Generator) -> Floats:
    count = int(np.clip(COST // cost_of(asked.system, Numerics(summation="plain")), LEAST, MOST))
    kept: list[Floats] = []
    for _ in range(DRAWS):
        q, p = _box(orbit, 2 * count, random)
        if asked.energy is not None:
            q, p = _on_surface(asked, orbit, q, p)
        rows = _rows(asked.system, q, p)
        kept.extend(rows[_stays(asked, rows, t_end, tau)])
        if len(kept) >= count:
            return np.array(kept[:count])
    if len(kept) < FEWEST:
        found = f"from {len(kept)} of {2 * DRAWS * count} starts the orbit stays on its energy surface"
        if asked.energy is not None:
            raise bad_setting("energy", asked.energy, f"one at which orbits of {asked.system.name} are bound: {found}")
        raise bad_setting("system", asked.system.name, f"one whose start has bound orbits near it: {found}")
    return np.array(kept)


def _box(orbit: Orbit, count: int, random: np.random.Generator) -> tuple[Floats, Floats]:
    at = random.integers(len(orbit.q), size=count)
    spread_q, spread_p = orbit.amplitudes
    q = orbit.q[at] + HALF_EDGE * spread_q * random.uniform(-1, 1, orbit.q[at].shape)
    p = orbit.p[at] + HALF_EDGE * spread_p * random.uniform(-1, 1, orbit.p[at].shape)
    return q, p


def _on_surface(asked: Question, orbit: Orbit, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Return states of the requested energy: momenta are scaled, and positions moved to lower V if this is necessary.

    Raises
    ------
    SettingError
        The potential is above the requested energy on the whole orbit.
    """
    energy, system = asked.energy, asked.system
    assert energy is not None
    still = np.zeros_like(p)
    lowest = orbit.q[_energies(system, orbit.q, np.zeros_like(orbit.q)).argmin()]
    room = energy - _energies(system, q, still)
    for part in SHRINKING:
        high = ~(room > 0)
        if not high.any():
            break
        nearer = lowest + part * (q[high] - lowest)
        found = energy - _energies(system, nearer, still[high])
        q[high], room[high] = np.where(found[:, None] > 0, nearer, q[high]), np.where(found > 0, found, room[high])
    inside = room > 0
    if not inside.any():
        least = float(_energies(system, lowest[None], still[:1])[0])
        raise bad_setting("energy", energy, f"above {least:.6g}, the least potential on the orbit of the given start")
    q, p = q[inside], p[inside]
    return q, p * _factors(system, q, p, energy)[:, None]


def _factors(system: System, q: Floats, p: Floats, energy: float) -> Floats:
    """Return the factor (M,) of each momentum, found by bisection because T need not be quadratic."""
    low, high = np.zeros(len(p)), np.ones(len(p))
    for _ in range(60):
        high = np.where(_energies(system, q, high[:, None] * p) < energy, 2 * high, high)
    for _ in range(80):
        middle = (low + high) / 2
        below = _energies(system, q, middle[:, None] * p) < energy
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def _energies(system: System, q: Floats, p: Floats) -> Floats:
    with np.errstate(all="ignore"):
        H: Floats = np.broadcast_to(system.energy(tuple(q.T), tuple(p.T), system.constants(float), 0.0), len(q))
    return np.array(H, dtype=float)


def _rows(system: System, q: Floats, p: Floats) -> Floats:
    finite = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    return start_array(system, q[finite], p[finite], plain=True)


def _stays(asked: Question, rows: Floats, t_end: float, tau: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return the mask of starts whose run with small steps keeps its energy."""
    method = integrators[METHOD]
    steps = method.steps(tau, t_end)
    run = integrate_batch(
        asked.system, method, t_end=Fraction(t_end), steps=[steps] * len(rows), samples=2, start=rows,
        scale=asked.scale, numerics=Numerics(summation="plain"),
    )  # fmt: skip
    kept: np.ndarray[tuple[int], np.dtype[np.bool_]] = run.max_energy_error < LARGEST_ERROR
    return kept
