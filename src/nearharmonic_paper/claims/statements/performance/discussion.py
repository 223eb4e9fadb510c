"""Section 5: stability with large steps, kinetic energies that are not quadratic, close encounters, higher order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, log

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.theory.oscillator import growth_rate, stability_gaps, stability_limit
from nearharmonic_paper.claims.claim import Decide, Decision, background, counted, either, result, tallied
from nearharmonic_paper.claims.judging import GENERALLY, GREATLY, LOST, SEVERAL, SIGNIFICANTLY, SMALL, Curves, curves_of
from nearharmonic_paper.claims.results import Results, label, once, require, short
from nearharmonic_paper.claims.statements.performance.comparisons import CUBES, NEW, SYSTEMS

METHODS = ("ruth", *NEW)
ABOVE = "above Ruth's, for each of the four new methods in the figures"
#: The paper's interval of time on the oscillator.
T_END = 500.0


def _above(found: Sequence[Mapping[str, float]], value: str, ratio: float) -> Decision:
    """Compare the step sizes of the new methods with Ruth's, system by system."""
    good = [ends[name] > ratio * ends["ruth"] for ends in found for name in NEW]
    return tallied(good, "above Ruth's", f"; {value}")


def _ends_in_words(ends: Mapping[str, float]) -> str:
    return ", ".join(f"{label(name)} {short(end) if end < inf else 'none'}" for name, end in ends.items())


def _on_each_system(words: str, end: Callable[[Curves, Floats], float]) -> Decide:
    """Judge of a step size that is read off a curve of maximum errors."""

    def decide(results: Results, ratio: float) -> Decision:
        found, told = [], []
        for system, name in SYSTEMS.items():
            curves = curves_of(results, system)
            found.append({method: end(curves, curves.errors([method])[0]) for method in METHODS})
            told.append(f"{name} {_ends_in_words(found[-1])}{curves.unit}")
        return _above(found, f"{words}: {'; '.join(told)}", ratio)

    return decide


def _of_each_method(words: str, end: Callable[[Tableau], float]) -> Decide:
    """Judge of a step size that follows from the coefficients."""

    @once
    def ends(results: Results) -> dict[str, float]:
        return {name: end(results.method(name)) for name in METHODS}

    def decide(results: Results, ratio: float) -> Decision:
        return _above([ends(results)], f"{words}: {_ends_in_words(ends(results))}", ratio)

    return decide


def _loss(curves: Curves, error: Floats) -> float:
    return float(curves.x[error > LOST].min(initial=inf))


def _limit(method: Tableau) -> float:
    return float(stability_limit(method)) / method.stages


def _growing(method: Tableau) -> float:
    """Return the first step size per stage at which the oscillator grows by a factor of ten in a gap of stability."""
    for low, high in stability_gaps(method):
        # Growth rises from the edge of a gap; the last gap has no end.
        steps = np.linspace(float(low), min(float(high), 1.5 * float(low)), 402)[1:-1]
        for tau in steps:
            if float(growth_rate(method, tau)) / tau * T_END >= log(GREATLY.number):
                return float(tau) / method.stages
    return inf


def _spike(curves: Curves, error: Floats) -> float:
    """The first step size, above those that are rounding, with ten times the error of a larger one."""
    asked = curves.compared(error, kept=np.where(np.isfinite(error), 0.0, inf))
    later = np.minimum.accumulate(error[::-1])[::-1]
    spiked = asked.asked[:-1] & (error[:-1] >= GREATLY.number * later[1:])
    lost = ~np.isfinite(error)
    return float(curves.x[:-1][spiked].min(initial=float(curves.x[lost].min(initial=inf))))


#: High numerical stability is four things, each with its number. Step sizes are per stage, which is at equal cost.
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


@result(
    paper="Section 5, Discussion",
    sentence="The performance of the obtained integrators generally declines for systems where T(p) deviates "
    "significantly from a squared kinetic energy",
    statement="The performance generally declines where T deviates significantly from a squared kinetic energy",
    threshold="on a relativistic oscillator at τ/s = 0.05 the maximum error is more than 1.26 times that with the "
    "roles of T and V exchanged, where V is not quadratic, and the ratio is above Ruth's, for more than half of the "
    "new methods at the amplitudes 0.1 and 1, where T is off a square by 0.25 % and by a sixth; "
    f"{SIGNIFICANTLY.brief}; {GENERALLY.brief}",
    bound=SIGNIFICANTLY.number,
    needs=("cubes/kinetic_energy.h5",),
)
def t_not_quadratic(results: Results, least: float) -> Decision:
    good, told = [], []
    for amplitude, (ruth, *new) in _by_roles(results).items():
        good += [one > max(least, ruth) for one in new]
        listed = ", ".join(f"{label(name)} {short(one, 2)}" for name, one in zip(NEW, new, strict=True))
        told.append(f"at amplitude {short(amplitude)} {listed}, Ruth {short(ruth, 2)}")
    value = f"error over that with the roles exchanged: {'; '.join(told)}"
    return either(sum(good) > GENERALLY.number * len(good), value)


@once
def _by_roles(results: Results) -> dict[float, list[float]]:
    """Errors over those with the roles exchanged by amplitude, of Ruth's method and of the new ones."""
    cube = results.cube("kinetic_energy")
    for name in ("ruth", *NEW):
        require(name in cube["integrator"].values, f"the results do not have the method {label(name)}")
    errors = cube["max_energy_error"].sel(tau_per_stage=0.05, method="nearest").sel(integrator=["ruth", *NEW])
    ratios = errors.sel(roles="own") / errors.sel(roles="exchanged")
    return {one: ratios.sel(amplitude=one, method="nearest").values.tolist() for one in (0.1, 1.0)}


#: Evaluations of the force an orbit, as in the figures of Kepler maps, and a round orbit beside those that come close.
EVALUATIONS, ROUND, CLOSE = 400, 0.2, 0.95


@background(
    paper="Section 5, Discussion",
    sentence="Close encounters in the gravitational N-body system inevitably cause high errors ultimately waiving "
    "symplectic properties of SIs",
    statement="Close encounters cause high errors: at fixed steps energy is lost on an orbit of high eccentricity",
    threshold=f"with each method, at {EVALUATIONS} evaluations an orbit, the relative energy error passes 1 within ten "
    f"periods on a Kepler orbit of eccentricity {CLOSE}, and stays below 1 % on one of eccentricity {ROUND}",
    bound=LOST,
    needs=("cubes/stability_kepler.h5",),
)
def close_encounters(results: Results, kept_below: float) -> Decision:
    cube = results.cube("stability_kepler")
    of_orbits = cube["energy_error"].sel(eccentricity=[ROUND, CLOSE], method="nearest").values
    places = abs(cube["evaluations_per_orbit"].values - EVALUATIONS).argmin(axis=1)
    kept, lost = zip(*(map(float, errors[place]) for errors, place in zip(of_orbits, places, strict=True)), strict=True)
    good = [one < kept_below and other == inf for one, other in zip(kept, lost, strict=True)]
    beside = f"; energy error at eccentricity {ROUND} {short(min(kept), 2)} to {short(max(kept), 2)}"
    return tallied(good, "methods lose the orbit", beside)


@background(
    paper="Section 5, Discussion",
    sentence="Higher order integrators are generally more constrained and usually involve several negative splitting "
    "coefficients with large absolute values",
    statement="Higher order integrators usually have several negative coefficients, and large ones among these",
    threshold="more than half of the registered methods of order 6 or more for any separable Hamiltonian have several "
    "negative coefficients, and more than half have a large one, below -1: not a small one; holds in part with one of "
    f"the two; {SEVERAL.brief}; {SMALL.brief}; {GENERALLY.brief}",
    bound=GENERALLY.number,
    needs=("tables/integrators.csv",),
)
def high_order_negative(results: Results, share: float) -> Decision:
    high = {row["integrator"]: row for row in results.rows("integrators") if int(row["order"]) >= 6}
    require(high, "the table of methods has none of order 6")
    several = [int(row["negative coefficients"]) >= SEVERAL.number for row in high.values()]
    most = {name: _most_negative(results.method(name)) for name in high}
    large = [one < -SMALL.number for one in most.values()]
    listed = [f"{label(name)} {high[name]['negative coefficients']} to {one:.2f}" for name, one in most.items()]
    new = min(_most_negative(results.method(name)) for name in NEW)
    value = f"several in {sum(several)} of {len(high)}, a large one in {sum(large)}; number and most negative: "
    value += f"{', '.join(listed)}; new methods to {new:.2f}"
    return counted([sum(good) > share * len(high) for good in (several, large)], value)


def _most_negative(method: Tableau) -> float:
    return min(float(c) for c in (*method.kick, *method.drift))
