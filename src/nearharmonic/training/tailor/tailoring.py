"""``nearharmonic.tailor``: starts, window, search, digits and test of a method for one system, in this order."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from nearharmonic.engine.numbers.initial_values import standard_parameters
from nearharmonic.errors import warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.integrators.theory.order import harmonic_order
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.training.objective import mean_errors
from nearharmonic.training.polish import tableau_of
from nearharmonic.training.population import Ensemble
from nearharmonic.training.tailor.budget import Budget
from nearharmonic.training.tailor.contenders import (
    CHARGE,
    check_window,
    contenders,
    published,
    registered,
    step_sizes,
    window_at,
)
from nearharmonic.training.tailor.inputs.starts import starts_of
from nearharmonic.training.tailor.orbit import RADIANS, STEP, Orbit, orbit_of
from nearharmonic.training.tailor.provenance import note_of, source_of
from nearharmonic.training.tailor.question import Question, question
from nearharmonic.training.tailor.result import Tailored, comparison
from nearharmonic.training.tailor.search import SearchResult, TailorSearch

Starts = Callable[[Question, Orbit], tuple[Ensemble, Ensemble]]

#: Ratio of the lengths of runs of the test and of the search.
LONGER = 4.0
#: Minimum number of steps per run, and maximum numbers of evaluations per run of the search and of the test.
FEWEST_STEPS, MOST_EVALUATIONS, MOST_IN_TEST = 24, 1600, 16000


class NoGainWarning(UserWarning):
    """A search found no method better than the registered ones."""


def tailor(
    system: str | os.PathLike[str] | System,
    *,
    stages: int | tuple[int, int] | str = 8,
    window: tuple[float, float] | str | None = None,
    error: float | str | None = None,
    seconds: float | None = None,
    trials: int | None = None,
    starts: Floats | str | os.PathLike[str] | None = None,
    energy: float | str | None = None,
    seed: int = 0,
) -> Tableau:
    """Make a symplectic method of order four for one system, and test it on other starts.

    The coefficients minimise the energy error. :func:`nearharmonic.integrate` and all other functions accept the
    returned method; its ``note`` describes the purpose and the gain.

    Parameters
    ----------
    system : str, path or System
        System, its name, or the path of a Python file that defines SYSTEM.
    stages : int, pair of int or str
        Number of stages of the method, 4 to 20; a pair, or "6:10", for the best in a range.
    window : pair of float or str, optional
        Smallest and largest step size over stages, in the unit of time of the system; their ratio is 1.2 to 10.
    error : float or str, optional
        Instead of a window: the energy error of the best registered method in its middle, by default 1e-6.
    seconds : float, optional
        Time of the search, by default 30.
    trials : int, optional
        Number of methods in the search. Without ``seconds`` it is the only budget, and equal seeds give equal methods.
    starts : (R, 2 d) array of float or path, optional
        Starts in place of drawn ones, at least eight: positions and then momenta, or a CSV file with such lines.
    energy : float or str, optional
        Energy of all drawn starts; "same" for the energy of the given one. By default starts are drawn in a box around
        the orbit of the given one.
    seed : int
        Of all random numbers.

    Returns
    -------
    Tableau
        The method, or the best registered method if the new method is not better on the starts of the test.

    Raises
    ------
    NearharmonicError
        An unknown name or an invalid setting, before any search.
    KeyboardInterrupt
        Ctrl-C before or after the search. Ctrl-C during the search ends it, and the best method so far is tested and
        returned.

    Warns
    -----
    NoGainWarning
        The returned method is a registered one.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> method = nh.tailor("henon_heiles", stages=8, window=(0.1, 0.15), trials=1000)
    >>> method.name, method.order
    ('tailored_henon_heiles_8', 4)
    """
    asked = question(
        system, stages=stages, window=window, error=error, seconds=seconds, trials=trials, starts=starts,
        energy=energy, seed=seed,
    )  # fmt: skip
    found = tailored(asked)
    if found.has_gain:
        return found.tableau
    best = found.test.overall
    message = (
        f"no gain over registered methods on starts that were not used: {found.test.gain} decades; this is {best.name}"
    )
    warn_caller(message, NoGainWarning)
    return best


def tailored(
    asked: Question, show: Callable[[float, float], None] | None = None, starts: Starts | None = None
) -> Tailored:
    """Return the tailored method and its test.

    Parameters
    ----------
    asked : Question
        The request.
    show : callable, optional
        Function that is called with the spent fraction of the budget and the smallest objective.
    starts : callable, optional
        Function that returns the starts of the search and those of the test in place of :func:`ensembles`.

    Raises
    ------
    SettingError
        A window in which no gain is possible, or starts that leave their energy surface.
    """
    subject, methods = asked.system, registered(asked.system)
    orbit = orbit_of(subject)
    ensemble, held_out = (starts or ensembles)(asked, orbit)
    window = asked.window or window_at(ensemble, methods, asked.error, orbit.frequency)
    ensemble = _fitted(ensemble, window, asked, MOST_EVALUATIONS)
    held_out = _fitted(held_out, window, asked, MOST_IN_TEST)
    taus = step_sizes(window)
    errors = mean_errors(ensemble, methods, taus.tolist(), CHARGE)
    check_window(errors.min(axis=0), window, subject.units["t"])
    budget = Budget(asked.seconds, asked.trials, show)
    search = TailorSearch(
        ensemble, taus, errors.min(axis=0), [one for one in methods if not one.modified], stages=asked.stages,
        quadratic=subject.quadratic_kinetic_energy, budget=budget, seed=asked.seed,
    ).run()  # fmt: skip
    return tested(asked, window, (ensemble, held_out), search, dict(zip(methods, errors, strict=True)))


def ensembles(asked: Question, orbit: Orbit) -> tuple[Ensemble, Ensemble]:
    """Return the starts of the search, for runs of twelve periods, and of the test, for runs four times as long."""
    subject = asked.system
    t_end = RADIANS / orbit.frequency
    step = min(STEP / orbit.frequency, np.inf if asked.window is None else asked.window[0])
    rows = starts_of(asked, orbit, LONGER * t_end, step)
    first, second = (
        Ensemble(
            name=name, system=subject, start=row, parameters=standard_parameters(subject)[None, :], t_end=end,
            scale=asked.scale,
        )
        for name, row, end in zip(("search", "test"), rows, (t_end, LONGER * t_end), strict=True)
    )  # fmt: skip
    return first, second


def _fitted(ensemble: Ensemble, window: tuple[float, float], asked: Question, most: int) -> Ensemble:
    """Adapt the length of the runs: enough steps at the upper end of the window, and not too many at the lower end."""
    least, highest = FEWEST_STEPS * max(asked.stages) * window[1], most * window[0]
    t_end = float(np.clip(ensemble.t_end, least, max(highest, least)))
    return replace(ensemble, t_end=float(f"{t_end:.3g}"))


def tested(
    asked: Question, window: tuple[float, float], ensembles: tuple[Ensemble, Ensemble], search: SearchResult,
    errors: Mapping[Tableau, Floats],
) -> Tailored:  # fmt: skip
    """Return the result of a search as a tableau, compared with methods of known ``errors`` (T,)."""
    (ensemble, held_out), best, taus = ensembles, search.best, step_sizes(window, between=True)
    stages, label = best.family.stages, asked.system.label
    name = f"tailored_{asked.system.name}_{stages}"
    tableau = tableau_of(best.family, best.unknowns.tolist(), name=name, label=f"{label}, {stages} stages", source="-")
    others = contenders(errors)
    of_others = contenders({one: errors[one] for one in published(errors)})
    found = Tailored(
        question=asked, window=window, ensemble=ensemble, held_out=held_out, tableau=tableau, search=search,
        test=comparison(tableau, others, held_out, taus, asked.seed),
        training=comparison(tableau, others, ensemble, taus, asked.seed),
        published=comparison(tableau, of_others, held_out, taus, asked.seed),
    )  # fmt: skip
    tableau = replace(tableau, harmonic_order=harmonic_order(tableau), source=source_of(found), note=note_of(found))
    return replace(found, tableau=tableau)
