"""Poincare sections: the states of many trajectories where they cross a surface, to rounding."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.numbers.arrays import rows_of
from nearharmonic.engine.numbers.initial_values import parameter_array, standard_parameters
from nearharmonic.engine.runs.continuation import parameter_attributes
from nearharmonic.engine.runs.description import problem_attributes
from nearharmonic.engine.runs.ensemble import ensemble
from nearharmonic.engine.runs.setup import Setup, warn_of_step
from nearharmonic.engine.settings import checked_tau, one_of
from nearharmonic.engine.stepper import stepper
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import is_real
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Signs of the surface function before a crossing.
DIRECTIONS = {"up": (-1,), "down": (1,), "both": (-1, 1)}
#: Bytes of states at a time, and of the numbers of one state per coordinate.
MOST_BYTES, PER_COORDINATE = 200_000_000, 8 * 8
#: Most steps of a search for a crossing, twice as many as halve an interval to rounding; and steps in a row after
#: which a search ends because the function came no nearer to zero: it is then at its own rounding errors.
MOST_TRIALS, MOST_IN_VAIN = 106, 4

Surface = Callable[..., Any]


def section(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    surface: int | Surface,
    direction: str = "up",
    starts: object = None,
    parameters: Mapping[str, Any] | None = None,
    t_end: float | str | None = None,
    first: str | None = None,
    threads: int = 1,
) -> xr.Dataset:
    """Return the states at which trajectories cross a surface in phase space, a Poincare section.

    The trajectories run with the step size ``tau``, in SIMD lanes. Where the surface function changes its sign in a
    step, this step is repeated with a smaller size, aside of the trajectory, so that it ends on the surface (after
    M. Henon, 1982, Physica D 5, 412, with steps of the integrator in place of another variable of integration). Such a
    step is symplectic as all others, so that crossings conserve the energy as well as the trajectory does.

    Parameters
    ----------
    system, integrator, tau
        As for :func:`nearharmonic.integrate`.
    surface : int or callable
        The coordinate whose zero is the surface, counted from 0; or a function ``g(q, p, *parameters)`` that is zero on
        the surface. It is called with tuples of floats and of arrays.
    direction : {"up", "down", "both"}
        Crossings from negative to positive values of the function, the reverse, or all.
    starts : (M, 2 d) array of float, optional
        Start of each trajectory, positions and then momenta; by default that of the system. A section shows one energy
        if all starts have it.
    parameters : mapping, optional
        One value by name for all trajectories.
    t_end, first
        As for :func:`nearharmonic.integrate`.
    threads : int
        Threads that share the trajectories.

    Returns
    -------
    xarray.Dataset
        Over (member, crossing, component): ``q`` and ``p``; over (member, crossing): ``t``, ``energy_error``, ``(H -
        H0)/|H0|`` in double precision, or H - H0 if a start has H0 = 0, and ``surface``, the value of the function,
        zero to rounding; over member ``crossings``, their number. Members with fewer crossings than others end with
        NaN. A trajectory that diverges has the crossings before.

    Raises
    ------
    NearharmonicError
        An unknown name, a setting outside what is allowed, or a surface that cannot be evaluated, before any work; or
        too many steps to keep.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.section("henon_heiles", "babps8o7h", 0.4, surface=0, t_end=50)
    >>> found.crossings.item()
    7
    """
    problem = Setup(system, integrator, t_end=t_end, first=first, energy="none")
    subject, d = problem.system, problem.system.dimension
    if subject.time_dependent:
        raise bad_setting("system", subject.name, "a section is of a system that does not depend on time")
    signs = DIRECTIONS[one_of("direction", direction, tuple(DIRECTIONS))]
    rows = _starts(starts, subject)
    given = standard_parameters(subject)[None, :] if parameters is None else parameter_array(subject, parameters)
    if len(given) > 1:
        raise bad_setting("parameters", f"{len(given)} values", "one value of each parameter for all trajectories")
    constants = given[0, ::2].tolist()
    function = _Function(surface, subject, constants)
    function(rows[:, :d], rows[:, d:])  # a surface that cannot be evaluated ends the call here
    step = stepper(subject, problem.tableau, parameters=parameters)
    steps = problem.steps_of(tau)
    warn_of_step(problem, [asked_tau := checked_tau(tau)], [steps])
    size = float(problem.end) / steps
    found: list[list[tuple[float, Floats, Floats]]] = []
    block = max(1, MOST_BYTES // (PER_COORDINATE * d * (steps + 1)))
    for begin in range(0, len(rows), block):
        some = rows[begin : begin + block]
        runs = ensemble(
            subject, problem.tableau, tau, q0=some[:, :d], p0=some[:, d:], parameters=parameters, t_end=problem.t_end,
            samples=steps + 1, energy="none", threads=threads,
        )  # fmt: skip
        q, p = runs["q"].values, runs["p"].values
        values = function(q, p)
        for one, states in enumerate(zip(q, p, strict=True)):
            found.append([
                _crossing(step, function, (states[0][i], states[1][i]), i, size)
                for i in _changes(values[one], signs)
            ])  # fmt: skip
    attributes = problem_attributes(problem) | parameter_attributes(subject, parameters or {})
    attributes |= {"direction": direction, "surface_name": function.name, "tau_requested": asked_tau}
    variables = _variables(problem, found, rows, function, constants)
    variables["tau"] = (), np.array(size), described("step size as used, t_end / steps", subject.units["t"])
    return assembled(variables, [], attributes)


def _starts(given: Any, system: System) -> Floats:
    d = system.dimension
    if given is None:
        return np.concatenate(system.start(float))[None, :]
    allowed = f"an array (M, {2 * d}) of finite numbers, {d} positions and {d} momenta a row"
    return rows_of("starts", given, 2 * d, allowed)[..., 0]


class _Function:
    """The function that is zero on a surface, of states (..., d)."""

    def __init__(self, surface: int | Surface, system: System, constants: Sequence[float]) -> None:
        allowed = f"a coordinate from 0 to {system.dimension - 1}, or a function g(q, p, *parameters)"
        whole = is_real(surface) and isinstance(surface, Integral)
        if not callable(surface) and not (whole and 0 <= int(surface) < system.dimension):
            raise bad_setting("surface", surface, allowed)
        self._constants = constants
        self._function: Surface = surface if callable(surface) else (lambda q, p, *_: q[surface])
        self.name = getattr(surface, "__name__", "surface") if callable(surface) else f"q_{int(surface) + 1}"

    def __call__(self, q: Floats, p: Floats) -> Floats:
        shape = q.shape[:-1]
        try:
            with np.errstate(all="ignore"):  # a state may be too large for it
                value = self._function(tuple(np.moveaxis(q, -1, 0)), tuple(np.moveaxis(p, -1, 0)), *self._constants)
            return np.array(np.broadcast_to(np.asarray(value).astype(float, casting="same_kind"), shape))
        except Exception as error:
            what = f"a function g(q, p, *parameters) of numbers and arrays; it raises {type(error).__name__}: {error}"
            raise bad_setting("surface", self.name, what) from error


def _changes(values: Floats, signs: Sequence[int]) -> list[int]:
    """Return the steps in which the function changes its sign, from one of ``signs`` on; zero counts as behind it."""
    before, after = values[:-1], values[1:]
    changes = np.zeros(len(before), bool)
    for sign in signs:
        changes |= (sign * before > 0) & (sign * after <= 0)
    return np.flatnonzero(changes).tolist()


def _crossing(
    step: Any, function: _Function, state: tuple[Floats, Floats], number: int, size: float
) -> tuple[float, Floats, Floats]:
    """Return time, position and momentum where a shortened step from ``state`` ends on the surface."""

    def at(share: float) -> tuple[float, Floats, Floats]:
        q, p = state[0].copy(), state[1].copy()
        step(q, p, share * size)
        return float(function(q, p)), q, p

    def same(a: float, b: float) -> bool:
        return (a < 0) == (b < 0)

    low, high, share, best = 0.0, 1.0, 1.0, at(1.0)
    f_low, f_high, turn, in_vain = float(function(*state)), best[0], 0, 0
    smallest = np.finfo(float).eps * (abs(f_low) + abs(f_high))
    for _ in range(MOST_TRIALS):
        if abs(best[0]) <= smallest or in_vain == MOST_IN_VAIN:
            break
        middle = high - f_high * (high - low) / (f_high - f_low)  # regula falsi, as modified at the Illinois computer
        middle = middle if low < middle < high else (low + high) / 2
        if not low < middle < high:
            break
        value = at(middle)
        in_vain += 1
        if abs(value[0]) < abs(best[0]):
            best, share, in_vain = value, middle, 0
        if same(value[0], f_low):
            low, f_low, f_high = middle, value[0], f_high / 2 if turn < 0 else f_high
            turn = -1
        else:
            high, f_high, f_low = middle, value[0], f_low / 2 if turn > 0 else f_low
            turn = 1
    return (number + share) * size, best[1], best[2]


def _variables(
    problem: Setup, found: Sequence[Sequence[tuple[float, Floats, Floats]]], rows: Floats, function: _Function,
    constants: Sequence[float],
) -> Variables:  # fmt: skip
    d, units = problem.system.dimension, problem.system.units
    most = max(map(len, found))
    t, q = np.full((len(found), most), np.nan), np.full((len(found), most, d), np.nan)
    p, error = q.copy(), t.copy()
    starts = [_energy(problem.system, row[:d], row[d:], constants) for row in rows]
    relative = all(starts)  # one unit for all members
    for i, (crossings, H0) in enumerate(zip(found, starts, strict=True)):
        for j, (time, position, momentum) in enumerate(crossings):
            t[i, j], q[i, j], p[i, j] = time, position, momentum
            error[i, j] = (_energy(problem.system, position, momentum, constants) - H0) / (abs(H0) if relative else 1.0)
    over, unit = ("member", "crossing"), "1" if relative else units["energy"]
    return {
        "t": (over, t, described("time of the crossing", units["t"])),
        "q": ((*over, "component"), q, described("position", units["q"])),
        "p": ((*over, "component"), p, described("momentum", units["p"])),
        "energy_error": (over, error, described(f"(H - H0){'/|H0|' if relative else ''} at the crossing", unit)),
        "surface": (over, function(q, p), described("function that is zero on the surface", "unknown")),
        "crossings": (("member",), np.array(list(map(len, found))), described("number of crossings")),
    }


def _energy(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> float:
    return float(system.energy(tuple(q.tolist()), tuple(p.tolist()), constants, 0.0))
