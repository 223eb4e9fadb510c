"""Request for a method for one system, validated before any search: its orbit, starts, and window of step sizes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, log, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import cost_of
from nearharmonic.engine.numbers import exact, rows_of, start_array
from nearharmonic.engine.settings import Numerics, checked_count, checked_tau, misfit
from nearharmonic.engine.setup import ANY, Setup, as_python, energy_at_start
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.written import decimal_of, integer_of, is_real
from nearharmonic.systems.quantities import is_list
from nearharmonic.systems.system import System
from nearharmonic.training.objective import LEAST, LOST, Ensemble, mean_errors

# --- Files of starts: one line per start, with the positions and then the momenta.

#: Minimum number of starts: four for the search, and four for the test.
FEWEST = 8


def read_starts(place: str | os.PathLike[str], dimension: int) -> Floats:
    """Return the starts (R, 2 d) of a CSV file, with d positions and d momenta per line, d = ``dimension``.

    The first line may be a header; ``#`` begins a comment.
    """
    path = Path(place)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text in UTF-8"
        raise bad_setting("starts", str(path), f"a file that can be read: {reason}") from None
    rows: list[list[float]] = []
    header = True
    for number, line in enumerate(lines, start=1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        cells = text.split(",")
        try:
            rows.append(_row(cells, dimension))
        except ValueError as fault:
            if not (header and not rows and _is_header(cells)):
                raise SettingError(f"{path}, line {number}: {fault}") from None
        header = False
    found = np.array(rows).reshape(-1, 2 * dimension)
    least_starts("starts", str(path), found, dimension)
    return found


def least_starts(key: str, given: object, rows: Floats, dimension: int) -> None:
    """Raise an error for too few starts, another number of coordinates, or numbers that are not finite."""
    wanted = f"{2 * dimension} finite numbers a start, {dimension} positions and {dimension} momenta"
    if rows.ndim != 2 or rows.shape[1] != 2 * dimension or not np.isfinite(rows).all():
        raise bad_setting(key, given, wanted)
    if len(rows) < FEWEST:
        what = f"at least {FEWEST} starts, and there are {len(rows)}: half of them are kept for the test"
        raise bad_setting(key, given, what)


def _row(cells: list[str], dimension: int) -> list[float]:
    wanted = f"expected {2 * dimension} finite numbers, {dimension} positions and {dimension} momenta"
    try:
        numbers = [float(decimal_of(cell)) for cell in cells]
    except ValueError:
        raise ValueError(f"{wanted}, got {','.join(cells)!r}") from None
    if len(numbers) != 2 * dimension or not np.isfinite(numbers).all():
        raise ValueError(f"{wanted}, got {','.join(cells)!r}")
    return numbers


def _is_header(cells: list[str]) -> bool:
    """Return True if no cell is a number; an invalid first line with a number is an error."""
    for cell in cells:
        try:
            float(cell)
        except ValueError:
            continue
        return False
    return True


# --- Request for a method for one system, validated before any computation.

#: Smallest number of stages of a method of order four with free coefficients, and largest number that is searched.
FEWEST_STAGES, MOST_STAGES = 4, 20
#: Minimum ratio of the ends of a window: a gain at a single step size is not useful.
NARROWEST = 1.2
#: Maximum ratio of the ends of a window: no single method is the best over a wider window.
WIDEST = 10.0
#: Maximum number of coordinates of a system: a search needs thousands of runs.
MOST_COORDINATES = 100
#: Energy error in the middle of the window if neither the error nor the window is given.
ERROR = 1e-6
#: Defaults of the seconds of a search and of the seed; maximum of the trials and of the seed.
SECONDS, SEED, MOST_TRIALS, LARGEST_SEED = 30.0, 0, 10**8, 2**31 - 1
#: Value of the option for the energy of the given start.
SAME = "same"


@dataclass(frozen=True, kw_only=True)
class TailorRequest:
    """A system, and the requirements for its method: the arguments of :func:`nearharmonic.tailor`, checked.

    ``given`` is the Python literal of the name or path of the system, or the name of its object. ``scale`` is the
    reference energy of relative errors. Starts (R, 2 d) are positions and then momenta.
    """

    system: System
    given: str
    stages: tuple[int, ...]
    window: tuple[float, float] | None
    error: float
    seconds: float | None
    trials: int | None
    starts: Floats | None
    energy: float | None
    seed: int
    scale: float


def question(
    system: str | os.PathLike[str] | System,
    *,
    stages: object = 8,
    window: object = None,
    error: object = None,
    seconds: object = None,
    trials: object = None,
    starts: object = None,
    energy: object = None,
    seed: object = None,
) -> TailorRequest:
    """Validate a request; arguments as for :func:`nearharmonic.tailor`."""
    if window is not None and error is not None:
        raise bad_setting("error", error, "a window is given, and an error selects the window: give one of the two")
    if starts is not None and energy is not None:
        raise bad_setting("energy", energy, "starts are given, and they determine the energies")
    place = os.fspath(system) if isinstance(system, os.PathLike) else system
    problem = Setup(place, ANY)
    subject = problem.system
    if subject.regularisation is not None:
        what = "a system in its physical time: this one is regularised, and its steps are of a fictitious time"
        raise bad_setting("system", subject.name, what)
    if subject.dimension > MOST_COORDINATES:
        what = f"a system of at most {MOST_COORDINATES} coordinates, and it has {subject.dimension}: a search takes "
        raise bad_setting("system", subject.name, f"{what}thousands of runs. Tailor a method for a small copy of it")
    H0 = energy_at_start(subject)
    return TailorRequest(
        system=subject,
        given=as_python(place),
        stages=_stages(stages),
        window=None if window is None else _window(window),
        error=ERROR if error is None else _error(error),
        seconds=_seconds(seconds, trials),
        trials=None if trials is None else checked_count("trials", trials, MOST_TRIALS),
        starts=None if starts is None else _starts(starts, subject),
        energy=None if energy is None else _surface(energy, subject, H0),
        seed=SEED if seed is None else _seed(seed),
        scale=problem.scale or abs(H0) or 1.0,
    )


def _stages(given: Any) -> tuple[int, ...]:
    """Convert an integer, a pair, or text such as "8" or "6:10"."""
    allowed = f"integers from {FEWEST_STAGES} to {MOST_STAGES}, as 8, or 6:10 for all from 6 to 10"
    parts = _parts(given)
    try:
        ends = [checked_count("stages", integer_of(x) if isinstance(x, str) else x, MOST_STAGES) for x in parts]
    except ValueError:  # errors of this package are ValueErrors
        raise bad_setting("stages", given, allowed) from None
    if len(ends) > 2 or min(ends, default=0) < FEWEST_STAGES or ends != sorted(ends):
        raise bad_setting("stages", given, allowed)
    return tuple(range(ends[0], ends[-1] + 1))


def _window(given: Any) -> tuple[float, float]:
    """Convert a pair of numbers, or text such as "0.08:0.12"."""
    allowed = (
        "two step sizes per stage above 0 in the system's unit of time, LOW:HIGH, the higher one "
        f"{NARROWEST:g} to {WIDEST:g} times the lower one"
    )
    parts = _parts(given)
    try:
        ends = [checked_tau(x, "window") for x in parts]
    except SettingError:
        raise bad_setting("window", given, allowed) from None
    if len(ends) != 2 or not NARROWEST * (1 - 1e-9) <= ends[1] / ends[0] <= WIDEST * (1 + 1e-9):
        raise bad_setting("window", given, allowed)
    return ends[0], ends[1]


def _parts(given: Any) -> list[Any]:
    if isinstance(given, str):
        return given.split(":")
    return list(given) if is_list(given) and hasattr(given, "__len__") else [given]


def _error(given: object) -> float:
    error = checked_tau(given, "error")
    if error >= 1:
        raise bad_setting("error", given, "an energy error below 1, relative to the energy")
    return error


def _seconds(given: object, trials: object) -> float | None:
    if given is None:
        return SECONDS if trials is None else None
    return checked_tau(given, "seconds")


def _seed(given: object) -> int:
    if is_real(given) and given == 0:
        return 0
    return checked_count("seed", given, LARGEST_SEED)


def _surface(given: object, system: System, H0: float) -> float:
    if system.time_dependent:
        raise bad_setting(
            "energy", given, f"the energy of {system.name} depends on time, so its starts are drawn from a box"
        )
    if given == SAME:
        return H0
    try:
        return float(exact("energy", given))
    except SettingError:
        raise bad_setting("energy", given, f"a finite number, or {SAME} for the energy of the given start") from None


def _starts(given: Any, system: System) -> Floats:
    if isinstance(given, str | os.PathLike):
        return read_starts(given, system.dimension)
    d = system.dimension
    rows = rows_of("starts", given, 2 * d, f"{2 * d} finite numbers a start, {d} positions and {d} momenta")[..., 0]
    least_starts("starts", f"array of shape {rows.shape}", rows, d)
    return rows


# --- The orbit from the initial values of a system: states and fastest oscillation.

#: Integrator of the orbit, for every separable H, and its step per stage in radians of the fastest oscillation.
METHOD, STEP = "blanes_moan_s6o4", 0.03
#: Number of states that are kept, and number of states at which the frequency is computed.
SAMPLES, POINTS = 240, 12
#: Length of an orbit in radians of the fastest oscillation: twelve periods.
RADIANS = 24 * np.pi
#: Number of products of both Hessians with a vector, which converges to the eigenvector of the fastest oscillation.
PRODUCTS = 40
#: Relative displacement of momenta for the finite difference of the velocity.
DISPLACEMENT = 1e-6


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """Some states (S, d) of an orbit.

    ``frequency`` is the root of the mean square of the fastest frequency of small oscillations about these states, in
    the inverse unit of time.
    """

    q: Floats
    p: Floats
    frequency: float

    @property
    def amplitudes(self) -> tuple[Floats, Floats]:
        """Amplitude of each position and momentum (d,); for a constant component the mean of the others."""
        return _spread(self.q), _spread(self.p)


def orbit_of(system: System) -> Orbit:
    """Return the orbit from the initial values of a system over twelve periods of its fastest oscillation."""
    q, p = (np.array([row]) for row in system.start(float))
    frequency = fastest(system, q, p)
    for _ in range(2):  # the frequency at the start may differ from that on the orbit
        q, p = _states(system, frequency)
        frequency = fastest(system, q[:: len(q) // POINTS], p[:: len(p) // POINTS])
    if not (np.ptp(q, axis=0).any() or np.ptp(p, axis=0).any()):
        start = f"({list(system.q0)}, {list(system.p0)})"
        raise bad_setting("(q0, p0)", start, f"a start that moves; {system.name} rests there")
    return Orbit(q=q, p=p, frequency=frequency)


def fastest(system: System, q: Floats, p: Floats) -> float:
    """Return the root of the mean square of the fastest frequency of small oscillations about states (S, d).

    The square of the frequency is the largest |eigenvalue| of T'' V'', computed by repeated products. A negative
    eigenvalue is the square of a growth rate, which limits the step size in the same way.
    """
    with np.errstate(all="ignore"):
        squares = _squares(system, q.T, p.T)
    frequency = float(np.sqrt(np.abs(squares).mean()))
    if not 0 < frequency < np.inf:
        allowed = "one with a force that depends on the position along the orbit of its start"
        raise bad_setting("system", system.name, allowed)
    return frequency


def _squares(system: System, q: Floats, p: Floats) -> Floats:
    """Return the largest |eigenvalue| (S,) of T'' V'' at each state (d, S)."""
    d, parameters = len(q), system.constants(float)
    time = (np.zeros(q.shape[1]),) if system.time_dependent else ()
    grad_T = system.formulas().grad_T
    velocity = _rows(grad_T((*p, *time), *parameters)[:d], p)
    w = np.random.default_rng(d).normal(size=p.shape)
    size = np.zeros(p.shape[1])
    for _ in range(PRODUCTS):
        w = w / _largest(w)
        force = _rows(system.hessian_V_times(tuple(q), tuple(w), *time, *parameters), p)
        h = DISPLACEMENT * _largest(p) / _largest(force)
        after = (_rows(grad_T((*(p + h * force), *time), *parameters)[:d], p) - velocity) / h
        length = (w * w).sum(axis=0)  # 0 for a constant potential
        size = np.divide((after * w).sum(axis=0), length, out=np.zeros_like(length), where=length > 0)
        w = after
    return size


def _rows(components: Sequence[Any], like: Floats) -> Floats:
    """Return components as an array (d, S); some may be constants."""
    return np.array([np.broadcast_to(np.asarray(x, dtype=float), like.shape[1:]) for x in components])


def _largest(rows: Floats) -> Floats:
    """Return the largest modulus in each column, or 1 if all are 0."""
    largest = np.abs(rows).max(axis=0)
    found: Floats = np.where(largest > 0, largest, 1.0)
    return found


def _states(system: System, frequency: float) -> tuple[Floats, Floats]:
    method = integrators[METHOD]
    t_end = Fraction(RADIANS / frequency)
    steps = int(np.ceil(RADIANS / (STEP * method.stages)))
    run = integrate_batch(system, method, t_end=t_end, steps=[steps], samples=SAMPLES, numerics=Numerics())
    d = system.dimension
    q, p = run.q[0, :, :d], run.p[0, :, :d]
    if run.left_at[0] or not (np.isfinite(q).all() and np.isfinite(p).all()):
        what = f"a start whose orbit stays on its energy surface; the orbit of {system.name} leaves it"
        raise bad_setting("(q0, p0)", f"({list(system.q0)}, {list(system.p0)})", what)
    return q, p


def _spread(rows: Floats) -> Floats:
    spread: Floats = np.sqrt(2) * rows.std(axis=0)
    still = spread < 1e-9 * spread.max()
    if still.any() and not still.all():
        spread[still] = spread[~still].mean()
    return spread


# --- Starts in a box around the orbit of the given one, on an energy surface, or from the user; half are for the test.

#: Half of the edge length of the box around a state of the orbit, in amplitudes of each coordinate.
HALF_EDGE = 0.1
#: Bounds of the number of starts: the cheaper the force, the more starts are drawn.
COST, MOST, FEW = 512, 64, 16
#: Maximum number of draws, each with twice as many candidates as starts are needed.
DRAWS = 20
#: Largest energy error of a run with small steps; starts with larger errors (collision or escape) are omitted.
LARGEST_ERROR = 1e-2
#: Largest fraction of the way from the position of the lowest potential on the orbit to a state, if V is too high at
#: all states.
SHRINKING = np.linspace(1.0, 0.0, 41)[:-1]


def starts_of(asked: TailorRequest, orbit: Orbit, t_end: float, tau: float) -> tuple[Floats, Floats]:
    """Return starts (M, 4 D) for the search, and others for the test.

    All starts have to stay on their energy surface in runs of length ``t_end`` with the step size ``tau`` per stage, in
    the unit of time of the system.
    """
    random = np.random.default_rng([asked.seed, 1])
    if asked.starts is not None:
        d = asked.system.dimension
        rows = _finite_rows(asked.system, asked.starts[:, :d], asked.starts[:, d:])
        fine = _stays(asked, rows, t_end, tau)
        if not fine.all():
            number = int(np.argmin(fine)) + 1
            raise SettingError(f"starts: the orbit of start {number} of {len(rows)} leaves its energy surface")
        order = random.permutation(len(rows))
    else:
        rows = _drawn(asked, orbit, t_end, tau, random)
        order = np.arange(len(rows))
    return rows[order[::2]], rows[order[1::2]]


def _drawn(asked: TailorRequest, orbit: Orbit, t_end: float, tau: float, random: np.random.Generator) -> Floats:
    count = int(np.clip(COST // cost_of(asked.system, Numerics(summation="plain")), FEW, MOST))
    kept: list[Floats] = []
    for _ in range(DRAWS):
        q, p = _box(orbit, 2 * count, random)
        if asked.energy is not None:
            q, p = _on_surface(asked, orbit, q, p)
        rows = _finite_rows(asked.system, q, p)
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


def _on_surface(asked: TailorRequest, orbit: Orbit, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Return states of the requested energy: momenta are scaled, and positions moved to lower V if necessary."""
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
        raise bad_setting("energy", energy, f"above {least:.6g}, the smallest V on the orbit of the given start")
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


def _finite_rows(system: System, q: Floats, p: Floats) -> Floats:
    finite = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    return start_array(system, q[finite], p[finite], plain=True)


def _stays(asked: TailorRequest, rows: Floats, t_end: float, tau: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return the mask of starts whose run with small steps keeps its energy."""
    method = integrators[METHOD]
    steps = method.steps(tau, t_end)
    run = integrate_batch(
        asked.system, method, t_end=Fraction(t_end), steps=[steps] * len(rows), samples=2, start=rows,
        scale=asked.scale, numerics=Numerics(summation="plain"),
    )  # fmt: skip
    kept: np.ndarray[tuple[int], np.dtype[np.bool_]] = run.max_energy_error < LARGEST_ERROR
    return kept


# --- Registered methods for comparison with a tailored one, and the window of step sizes.

#: Step sizes per stage, in radians of the fastest oscillation, for the search for a window.
LADDER = np.geomspace(0.01, 1.0, 25)
#: Number of problems in the search for a window.
PROBLEMS = 8
#: Ratio of the largest to the smallest step size of a window that is found.
WINDOW_RATIO = 1.5
#: Range of rounding errors, in decades above the smallest distinguished error.
ROUNDING = 2.0
#: Decades: a method that is less than this behind the best on the starts of the search may be the best on the starts of
#: the test.
BEHIND = 1.0
#: Assumed cost of the gradient of the square of grad V, in forces, for comparisons at equal cost. Measured costs are
#: below or slightly above it, see docs/reference/methods.md.
CHARGE = 1.0
#: Largest ratio of neighbouring step sizes in a window, and minimum number of step sizes.
RATIO, FEWEST_SIZES = 1.26, 3


def registered(system: System) -> list[Tableau]:
    """Return the registered splitting methods that fit a system, except processed ones.

    The energy of a processed method is not measured at every step.
    """
    found = [integrators[name] for name in integrators.registered]
    return [one for one in found if not (one.processed or one.implicit or misfit(system, one)[0])]


def step_sizes(window: tuple[float, float], *, between: bool = False) -> Floats:
    """Return step sizes per stage (T,) that cover a window, with intermediate ones if ``between`` is set."""
    count = max(FEWEST_SIZES, ceil(log(window[1] / window[0]) / log(RATIO)) + 1)
    found: Floats = np.geomspace(*window, 2 * count - 1 if between else count)
    return found


def window_at(ensemble: Ensemble, methods: list[Tableau], error: float, frequency: float) -> tuple[float, float]:
    """Return the window in whose middle the best of some methods has a given error.

    The error is the geometric mean of max |dH| over the problems, relative to the energy; ``frequency`` is the angular
    frequency of the fastest oscillation.
    """
    ladder, few = LADDER / frequency, ensemble.part(slice(PROBLEMS))
    best = np.minimum.accumulate(mean_errors(few, methods, ladder.tolist(), CHARGE).min(axis=0)[::-1])[::-1]
    wanted, lowest, highest = np.log10(error), best[0], best[-1]
    if not lowest < wanted < highest:
        what = (
            f"between {10**lowest:.2g} and {10**highest:.2g}, the errors of the best registered methods at step sizes "
            f"per stage from {ladder[0]:.3g} to {ladder[-1]:.3g}; or give a window"
        )
        raise bad_setting("error", error, what)
    place = int(np.argmax(best > wanted))
    part = (wanted - best[place - 1]) / (best[place] - best[place - 1])
    middle = float(np.exp((1 - part) * np.log(ladder[place - 1]) + part * np.log(ladder[place])))
    low, high = (float(f"{x:.3g}") for x in (middle / sqrt(WINDOW_RATIO), middle * sqrt(WINDOW_RATIO)))
    return low, high


def contenders(errors: Mapping[Tableau, Floats]) -> list[Tableau]:
    """Return the methods that are near the best at some step size, by their mean log10 errors (T,)."""
    best = np.min([*errors.values()], axis=0)
    return [one for one, error in errors.items() if (error < best + BEHIND).any()]


def check_window(best: Floats, window: tuple[float, float], unit: str) -> None:
    """Raise an error for a window in which no gain is possible.

    ``best`` (T,) is the mean of log10 max |dH| of the best registered method at each step size of the window; ``unit``
    is the unit of time.
    """
    shown = f"{window[0]:g}:{window[1]:g}"
    time = "" if unit == "1" else f" {unit}"
    if best[-1] >= np.log10(LOST):
        what = f"every registered method loses the energy at {window[1]:g}{time} per stage: take smaller step sizes"
        raise bad_setting("window", shown, what)
    if best[-1] < np.log10(LEAST) + ROUNDING:
        what = f"registered methods err by rounding alone up to {window[1]:g}{time} per stage: take larger step sizes"
        raise bad_setting("window", shown, what)
