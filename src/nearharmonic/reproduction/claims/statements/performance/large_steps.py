"""Section 5: high numerical stability allowing large steps, which is four things, each with its number.

Step sizes are per stage, which is at equal cost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, log

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.reproduction.claims.claim import Decide, Decision, result, tallied
from nearharmonic.reproduction.claims.judging.curves import LOST, Curves, curves_of
from nearharmonic.reproduction.claims.judging.definitions import GREATLY
from nearharmonic.reproduction.claims.results import Results, label, short
from nearharmonic.reproduction.claims.statements.performance.comparisons import CUBES, NEW, SYSTEMS
from nearharmonic.theory.linear_stability import growth_rate, stability_gaps, stability_limit

METHODS = ("ruth", *NEW)
ABOVE = "above Ruth's, for each of the four new methods in the figures"
#: The paper's interval of time on the oscillator.
T_END = 500.0


def _above(found: Sequence[Mapping[str, float]], value: str, ratio: float) -> Decision:
    """Compare the step sizes of the new methods with Ruth's, system by system."""
    good = [ends[name] > ratio * ends["ruth"] for ends in found for name in NEW]
    return tallied(good, "above Ruth's", f"; {value}")


def _listed(ends: Mapping[str, float]) -> str:
    return ", ".join(f"{label(name)} {short(end) if end < inf else 'none'}" for name, end in ends.items())


def _on_each_system(words: str, end: Callable[[Curves, Floats], float]) -> Decide:
    """Judge of a step size that is read off a curve of maximum errors."""

    def decide(results: Results, ratio: float) -> Decision:
        found, told = [], []
        for system, name in SYSTEMS.items():
            curves = curves_of(results, system)
            found.append({method: end(curves, curves.errors([method])[0]) for method in METHODS})
            told.append(f"{name} {_listed(found[-1])}{curves.unit}")
        return _above(found, f"{words}: {'; '.join(told)}", ratio)

    return decide


def _of_each_method(words: str, end: Callable[[Tableau], float]) -> Decide:
    """Judge of a step size that follows from the coefficients."""

    def decide(results: Results, ratio: float) -> Decision:
        found = results.kept(("step size", words), lambda: {name: end(results.method(name)) for name in METHODS})
        return _above([found], f"{words}: {_listed(found)}", ratio)

    return decide


def _loss(curves: Curves, error: Floats) -> float:
    return float(curves.x[error > LOST].min(initial=inf))


def _limit(method: Tableau) -> float:
    return float(stability_limit(method)) / method.stages


def _growing(method: Tableau) -> float:
    """The first step size per stage at which a gap of stability makes the oscillator grow by ten."""
    for low, high in stability_gaps(method):
        # Growth rises from the edge of a gap; the last gap has no end.
        steps = np.linspace(float(low), min(float(high), 1.5 * float(low)), 402)[1:-1]
        rates = np.array([float(growth_rate(method, tau)) / tau for tau in steps])
        enough = np.flatnonzero(rates * T_END >= log(GREATLY.number))
        if enough.size:
            return float(steps[enough[0]]) / method.stages
    return inf


def _spike(curves: Curves, error: Floats) -> float:
    """The first step size, above those that are rounding, with ten times the error of a larger one."""
    asked = curves.compared(error, kept=np.where(np.isfinite(error), 0.0, inf))
    later = np.minimum.accumulate(error[::-1])[::-1]
    spiked = asked.asked[:-1] & (error[:-1] >= GREATLY.number * later[1:])
    lost = ~np.isfinite(error)
    return float(curves.x[:-1][spiked].min(initial=float(curves.x[lost].min(initial=inf))))


STABILITY = tuple(
    result(
        id=name,
        paper="Section 5, Discussion",
        sentence="Optimized fourth order schemes appear to be useful for achieving high numerical stability allowing "
        "large time steps with minimal integration error",
        statement=statement,
        threshold=threshold,
        bound=1.0,
        needs=needs,
    )(judge)
    for name, statement, threshold, needs, judge in (
        (
            "stable-with-large-steps",
            "Large steps with small errors: the maximum error passes 1 % at a larger τ/s than Ruth's",
            f"the smallest τ/s at which the maximum error passes 1 % {ABOVE}, on each system",
            CUBES,
            _on_each_system("τ/s of an error of 1 %", _loss),
        ),
        (
            "stable-linear-limit",
            "Linear stability: the limit of stability on the oscillator is at a larger τ/s than Ruth's",
            f"the smallest τ/s at which |tr K| of the step matrix K passes 2, proved, {ABOVE}",
            (),
            _of_each_method("τ/s of the limit", _limit),
        ),
        (
            "stable-growth",
            "Visible instability: the amplitude on the oscillator grows tenfold at a larger τ/s than Ruth's",
            f"the smallest τ/s at which the step matrix grows tenfold over t = {T_END:.0f} {ABOVE}; where |tr K| "
            "passes 2 for the first time, the gap of stability may be too narrow for that",
            (),
            _of_each_method("τ/s", _growing),
        ),
        (
            "stable-first-spike",
            "Resonances: the first spike of the maximum error is at a larger τ/s than Ruth's",
            "the smallest τ/s whose maximum error is at least ten times that of a larger one, or, if there is none, "
            f"at which a run diverges, {ABOVE}, on each system",
            CUBES,
            _on_each_system("τ/s", _spike),
        ),
    )
)
