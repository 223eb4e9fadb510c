"""Registered methods for comparison with a tailored one, and the window of step sizes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import ceil, log, sqrt

import numpy as np

from nearharmonic.engine.grid import misfit
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.training.objective import mean_errors
from nearharmonic.training.population import LEAST, LOST, Ensemble
from nearharmonic.training.published import OURS, module_of

#: Step sizes per stage, in radians of the fastest oscillation, for the search for a window.
LADDER = np.geomspace(0.01, 1.0, 25)
#: Number of problems in the search for a window.
PROBLEMS = 8
#: Ratio of the largest to the smallest step size of a window that is found.
WIDTH = 1.5
#: Range of rounding errors, in decades above the smallest distinguished error.
ROUNDING = 2.0
#: Decades: a method that is less than this behind the best on the starts of the search may be the best on the starts of
#: the test.
BEHIND = 1.0
#: Assumed cost of the gradient of the square of grad V, in forces, for comparisons at equal cost. Measured costs are
#: below or slightly above it, see docs/reference/methods.md.
CHARGE = 1.0
#: Largest ratio of neighbouring step sizes in a window, and minimum number of step sizes.
RATIO, FEWEST = 1.26, 3


def registered(system: System) -> list[Tableau]:
    """Return the registered splitting methods that fit a system, except processed ones.

    The energy of a processed method is not measured at every step.
    """
    found = [integrators[name] for name in integrators.registered]
    return [one for one in found if not (one.processed or one.implicit or misfit(system, one)[0])]


def published(methods: Iterable[Tableau]) -> list[Tableau]:
    """Return the methods of other authors among registered ones."""
    return [one for one in methods if module_of(one.name) not in OURS]


def step_sizes(window: tuple[float, float], *, between: bool = False) -> Floats:
    """Return step sizes per stage (T,) that cover a window, with intermediate ones if ``between`` is set."""
    count = max(FEWEST, ceil(log(window[1] / window[0]) / log(RATIO)) + 1)
    found: Floats = np.geomspace(*window, 2 * count - 1 if between else count)
    return found


def window_at(ensemble: Ensemble, methods: list[Tableau], error: float, frequency: float) -> tuple[float, float]:
    """Return the window in whose middle the best of some methods has a given error.

    Parameters
    ----------
    ensemble, methods
        Problems, and methods.
    error : float
        Geometric mean of max |dH| over the problems, relative to the energy.
    frequency : float
        Angular frequency of the fastest oscillation.

    Raises
    ------
    SettingError
        No step size of :data:`LADDER` has this error.
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
    low, high = (float(f"{x:.3g}") for x in (middle / sqrt(WIDTH), middle * sqrt(WIDTH)))
    return low, high


def contenders(errors: Mapping[Tableau, Floats]) -> list[Tableau]:
    """Return the methods that are near the best at some step size, by their mean log10 errors (T,)."""
    best = np.min([*errors.values()], axis=0)
    return [one for one, error in errors.items() if (error < best + BEHIND).any()]


def check_window(best: Floats, window: tuple[float, float], unit: str) -> None:
    """Raise an error for a window in which no gain is possible.

    Parameters
    ----------
    best : (T,) array of float
        Mean of log10 max |dH| of the best registered method at each step size of the window.
    window : pair of float
        Ends of the window.
    unit : str
        Unit of time, for the message.

    Raises
    ------
    SettingError
        All methods diverge at the upper end, or one method reaches the rounding errors of doubles in the whole window.
    """
    shown = f"{window[0]:g}:{window[1]:g}"
    time = "" if unit == "1" else f" {unit}"
    if best[-1] >= np.log10(LOST):
        what = f"every registered method loses the energy at {window[1]:g}{time} per stage: take smaller step sizes"
        raise bad_setting("window", shown, what)
    if best[-1] < np.log10(LEAST) + ROUNDING:
        what = f"registered methods err by rounding alone up to {window[1]:g}{time} per stage: take larger step sizes"
        raise bad_setting("window", shown, what)
