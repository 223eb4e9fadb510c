"""Choices of other libraries, from the timings of a finished target ``work_precision``."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import isnan, nan
from pathlib import Path

from nearharmonic.recommendation.curve import MEASURES, Curve
from nearharmonic.recommendation.question import Question
from nearharmonic.recommendation.recommendation import Choice
from nearharmonic.recommendation.step_search import fewest_steps
from nearharmonic.systems import systems

CUBE = Path("cubes/work_precision.h5")
#: Fields of a point that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Mode that is timed: one trajectory.
TIMED = "trajectory"


def library_choices(asked: Question, results: Path) -> tuple[list[Choice], str]:
    """Return the choices of other libraries from the timings in a folder of results, and their origin as text.

    Raises
    ------
    ResultFileError
        The file of timings cannot be read.
    """
    path, system = results / CUBE, asked.system
    if system.name not in systems or systems[system.name] is not system:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    from nearharmonic.recommendation.timings import read_parts

    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if asked.measure in measures and Fraction(end) == Fraction(asked.t_end):
            choices = [_choice(curve, asked) for curve in curves if curve.kind == "peer"]
            return choices, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _choice(curve: Curve, asked: Question) -> Choice:
    """Return the fastest setting that meets the bound, if all finer settings meet it too."""
    reason = "" if curve.status == "ok" else curve.status
    choice = Choice(method=curve.method, label=curve.label, kind="peer", status="not run", reason=reason)
    if not curve.points:
        return choice
    errors = {i: float(getattr(point, MEASURES[asked.measure])) for i, point in enumerate(curve.points)}
    times = [min(point.times.get(TIMED, ()), default=nan) for point in curve.points]
    first = fewest_steps(errors, asked.error)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = (
        min(settings, key=times.__getitem__) if settings else min(errors, key=lambda i: (isnan(errors[i]), errors[i]))
    )
    point = curve.points[best]
    return replace(
        choice,
        status="met" if settings else "missed",
        error=errors[best],
        time=times[best] if settings else nan,
        **{name: getattr(point, name) for name in SHARED},
    )
