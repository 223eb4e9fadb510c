"""Section 5: high numerical stability allowing large steps, which is four things, each with its number.

Step sizes are per stage, which is at equal cost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, log

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.reproduction.claims.claim import Decision, counted, result
from nearharmonic.reproduction.claims.judging.curves import LOST, Curves, curves_of
from nearharmonic.reproduction.claims.judging.definitions import GREATLY
from nearharmonic.reproduction.claims.results import Results, label, short
from nearharmonic.reproduction.claims.statements.performance.comparisons import CUBES, NEW, SYSTEMS
from nearharmonic.theory.linear_stability import growth_rate, stability_gaps, stability_limit

SENTENCE = (
    "Optimized fourth order schemes appear to be useful for achieving high numerical stability allowing large time "
    "steps with minimal integration error"
)
SECTION = "Section 5, Discussion"
METHODS = ("ruth", *NEW)
ABOVE = "above Ruth's, for each of the four new methods in the figures"


def _above(found: Sequence[Mapping[str, float]], value: str, ratio: float) -> Decision:
    """Compare the step sizes of the new methods with Ruth's, system by system."""
    good = [ends[name] > ratio * ends["ruth"] for ends in found for name in NEW]
    return counted(good, f"{sum(good)} of {len(good)} above Ruth's; {value}")


def _listed(ends: Mapping[str, float]) -> str:
    return ", ".join(f"{label(name)} {short(end) if end < inf else 'none'}" for name, end in ends.items())


@result(
    id="stable-with-large-steps",
    paper=SECTION,
    sentence=SENTENCE,
    statement="Large steps with small errors: the maximum error passes 1 % at a larger τ/s than Ruth's",
    threshold=f"the smallest τ/s at which the maximum error passes 1 % {ABOVE}, on each system",
    bound=1.0,
    needs=CUBES,
)
def stable_with_large_steps(results: Results, ratio: float) -> Decision:
    found, told = [], []
    for system, name in SYSTEMS.items():
        curves = curves_of(results, system)
        rows = zip(METHODS, curves.errors(METHODS), strict=True)
        found.append({method: float(curves.x[row > LOST].min(initial=inf)) for method, row in rows})
        told.append(f"{name} {_listed(found[-1])}{curves.unit}")
    return _above(found, f"τ/s of an error of 1 %: {'; '.join(told)}", ratio)


@result(
    id="stable-linear-limit",
    paper=SECTION,
    sentence=SENTENCE,
    statement="Linear stability: the limit of stability on the oscillator is at a larger τ/s than Ruth's",
    threshold=f"the smallest τ/s at which |tr K| of the step matrix K passes 2, proved, {ABOVE}",
    bound=1.0,
)
def stable_linear_limit(results: Results, ratio: float) -> Decision:
    limits = results.kept("limits", lambda: {name: _limit(results.method(name)) for name in METHODS})
    return _above([limits], f"τ/s of the limit: {_listed(limits)}", ratio)


def _limit(method: Tableau) -> float:
    return float(stability_limit(method)) / method.stages


#: The paper's interval of time on the oscillator.
T_END = 500.0


@result(
    id="stable-growth",
    paper=SECTION,
    sentence=SENTENCE,
    statement="Visible instability: the amplitude on the oscillator grows tenfold at a larger τ/s than Ruth's",
    threshold=f"the smallest τ/s at which the step matrix grows tenfold over t = {T_END:.0f} {ABOVE}; where |tr K| "
    "passes 2 for the first time, the gap of stability may be too narrow for that",
    bound=1.0,
)
def stable_growth(results: Results, ratio: float) -> Decision:
    found = results.kept("growth", lambda: {name: _growing(results.method(name)) for name in METHODS})
    return _above([found], f"τ/s: {_listed(found)}", ratio)


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


@result(
    id="stable-first-spike",
    paper=SECTION,
    sentence=SENTENCE,
    statement="Resonances: the first spike of the maximum error is at a larger τ/s than Ruth's",
    threshold="the smallest τ/s whose maximum error is at least ten times that of a larger one, or, if there is none, "
    f"at which a run diverges, {ABOVE}, on each system",
    bound=1.0,
    needs=CUBES,
)
def stable_first_spike(results: Results, ratio: float) -> Decision:
    found, told = [], []
    for system, name in SYSTEMS.items():
        curves = curves_of(results, system)
        found.append({method: _spike(curves, curves.errors([method])[0]) for method in METHODS})
        told.append(f"{name} {_listed(found[-1])}{curves.unit}")
    return _above(found, f"τ/s: {'; '.join(told)}", ratio)


def _spike(curves: Curves, error: Floats) -> float:
    """The first step size, above those that are rounding, with ten times the error of a larger one."""
    asked = curves.compared(error, kept=np.where(np.isfinite(error), 0.0, inf))
    later = np.minimum.accumulate(error[::-1])[::-1]
    spiked = asked.asked[:-1] & (error[:-1] >= GREATLY.number * later[1:])
    lost = ~np.isfinite(error)
    return float(curves.x[:-1][spiked].min(initial=float(curves.x[lost].min(initial=inf))))
