"""``nearharmonic.recommendation``: methods for an error bound as a Dataset."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.errors import warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.recommendation.measure import MEASURES
from nearharmonic.recommendation.search import Recommendation, question, recommendation
from nearharmonic.systems import System

if TYPE_CHECKING:
    import os

    import xarray as xr


def recommend(
    system: str | System,
    error: float | str,
    *,
    measure: str = "max",
    t_end: float | str | None = None,
    q0: object = None,
    p0: object = None,
    methods: Iterable[str | os.PathLike[str] | Tableau] | None = None,
    budget: int | None = None,
) -> xr.Dataset:
    """Rank methods by the time that each takes to integrate a system within an error bound.

    The step of each method is searched for, run over the whole interval, and timed during the call. It meets the bound,
    as do all finer steps that were run. It is below the limit of linear stability at the largest frequency along the
    orbit, and it is run again from perturbed starts and over four times the interval. On a terminal, a line for each
    method tells how far the search is.

    Parameters
    ----------
    system : str or System
        Problem, its name, or the path of a Python file that defines SYSTEM.
    error : float or str
        Error bound, above 0.
    measure : {"max", "mean", "position"}
        Bounded quantity: the maximum or the mean of the energy error over every step, or the distance at the end from
        the exact position, relative to the distance from the origin.
    t_end : float or str, optional
        End of the interval [0, t_end], above 0; a decimal string is exact. By default the system's own. Positions are
        compared at ``position_t_end`` of the system if that is earlier.
    q0, p0 : sequence of d numbers or strings, optional
        Initial values in place of the system's own, as for :func:`nearharmonic.integrate`. Either may be given alone.
        Rows (M, d) are an ensemble: errors are then the 0.99 quantile over its members, of at most 1024.
    methods : list, optional
        Methods to choose from: names, paths of files (one for all methods of its file), or Tableaus. By default all,
        of which those that need many more evaluations than ten others are not searched for.
    budget : int, optional
        Most evaluations of the force in a run that may be recommended, by default 200 000; the work of the search
        grows with it.

    Returns
    -------
    xarray.Dataset
        Over ``rank``, 1 for the fastest: ``integrator``, a name or a path as :func:`nearharmonic.integrate` takes it;
        ``label``; ``tau``, ``summation``, ``steps`` and ``evaluations`` of its run; ``max_energy_error`` and
        ``mean_energy_error``, which ``integrate`` finds for this ``tau`` and ``summation``, and ``position_error`` if
        that is the measure; ``time``, the least wall time of the run in s, of one trajectory on one core. Uncompensated
        sums are used where they do not increase the error. ``further_error`` is the largest error of the runs that
        confirm the step; methods for which it exceeds twice the bound come last, and the attribute ``unconfirmed``
        names them. Methods that miss the bound are left out: the attributes ``missed`` and ``not_run`` name them with
        the reason, ``basis`` tells what was checked and measured where, ``call`` is the Python code of the first run,
        in which a system that is not registered, and the starts of an ensemble, have their own names.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.recommend("sho", 1e-6, methods=["ruth", "babps8o7h"], t_end=50)
    >>> bool((found.max_energy_error <= 1e-6).all())
    True
    >>> sorted(found.integrator.values.tolist())
    ['babps8o7h', 'ruth']
    """
    asked = question(
        system, error, measure=measure, t_end=t_end, q0=q0, p0=p0, methods=methods, budget=budget
    )  # fmt: skip
    found = recommendation(asked)
    if not found.ranked:
        warn_caller(
            f"no method has an error of at most {asked.error} within {asked.budget} evaluations: attributes missed and "
            "not_run say how near each came; a larger budget= tries smaller step sizes"
        )
    return as_dataset(found)


def as_dataset(found: Recommendation) -> xr.Dataset:
    """Return the methods that meet the bound over ``rank``."""
    asked, best = found.question, found.ranked
    unit, further = asked.system.units["t"], asked.energy_attributes[MEASURES["max"]]

    def over(name: str, kind: type, attributes: dict[str, str]) -> tuple[tuple[str], Any, dict[str, str]]:
        return ("rank",), np.array([getattr(choice, name) for choice in best], dtype=kind), attributes

    variables: Variables = {
        "rank": (("rank",), np.arange(1, len(best) + 1), described("rank by wall time, 1 for the fastest")),
        "integrator": over("method", str, described("integrator, a name or the path of a file")),
        "label": over("label", str, described("name in legends")),
        "tau": over("tau", float, described("largest step size found that meets the bound", unit)),
        "summation": over("summation", str, described("summation of the run, as integrate takes it")),
        "steps": over("steps", int, described("steps that cover [0, t_end]")),
        "evaluations": over("evaluations", int, described("force evaluations made")),
        **{
            name: over(name, float, {**notes, "long_name": asked.over_members + notes["long_name"]})
            for name, notes in asked.energy_attributes.items()
        },
        "further_error": over(
            "further_error",
            float,
            described("largest energy error from other starts and over a longer interval", further["units"]),
        ),
        "time": over("time", float, described("least wall time of one run on one core, without start-up", "s")),
    }
    if asked.measure == "position":
        variables[MEASURES["position"]] = over("error", float, described(asked.quantity))
    return assembled(variables, ["rank", "label"], _attributes(found))


def _attributes(found: Recommendation) -> dict[str, Any]:
    asked = found.question
    q0, p0 = asked.system.start(float)
    return {
        "system": asked.system.name,
        "t_end": asked.t_end,
        "measure": asked.measure,
        "error": asked.error,
        "budget": asked.budget,
        **({"q0": json.dumps(q0), "p0": json.dumps(p0)} if len(asked.starts) == 1 else {"starts": len(asked.starts)}),
        "missed": found.missed("splitting"),
        "not_run": found.not_run(),
        "unconfirmed": found.unconfirmed,
        "basis": found.basis,
        "call": found.call,
        **({"energy_floor": asked.floor} if asked.floor else {}),
    }
