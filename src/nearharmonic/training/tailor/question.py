"""Request for a method for one system, validated before any computation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from nearharmonic.engine.numbers.arrays import exact, rows_of
from nearharmonic.engine.runs.invariants import energy_at_start
from nearharmonic.engine.runs.setup import ANY, Setup, as_python
from nearharmonic.engine.settings import checked_count, checked_tau
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import integer_of, is_real
from nearharmonic.systems.definition.quantities import is_list
from nearharmonic.systems.definition.system import System
from nearharmonic.training.tailor.inputs.start_file import least_starts, read_starts

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
class Question:
    """A system, and the requirements for its method.

    Attributes
    ----------
    system : System
        The system.
    given : str
        Python literal of the name or path of the system, or the name of its object.
    stages : tuple of int
        Numbers of stages that are searched.
    window : pair of float, or None
        Smallest and largest step size over stages, in the unit of time of the system.
    error : float
        Energy error of the best registered method in the middle of the window, if no window is given.
    seconds : float or None
        Time limit of the search.
    trials : int or None
        Maximum number of methods in the search.
    starts : (R, 2 d) array of float, or None
        Starts in place of drawn ones, positions and then momenta.
    energy : float or None
        Energy of all drawn starts; None for starts in a box around the orbit of the given one.
    seed : int
        Seed of all random numbers.
    scale : float
        Reference energy of relative errors.
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
) -> Question:
    """Validate a request; arguments as for :func:`nearharmonic.tailor`.

    Raises
    ------
    NearharmonicError
        An unknown name, an invalid setting, or a system for which no method can be made.
    """
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
    return Question(
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
