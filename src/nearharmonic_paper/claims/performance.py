"""Statements that compare methods on several systems: accuracy, stability, kinetic energies, close encounters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from math import inf, log

import numpy as np

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.theory.oscillator import growth_rate, stability_gaps, stability_limit, step_polynomials
from nearharmonic_paper.claims import judging
from nearharmonic_paper.claims.claim import (
    Decision,
    Results,
    Verdict,
    background,
    combined,
    counted,
    either,
    label,
    require,
    result,
    short,
    tallied,
)
from nearharmonic_paper.claims.tableaus import TRAINED, lead_of_trained

NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
BEFORE = ("ruth", "yoshida_s7o6a", "s5odr4", "aba104", "aba864", "aba1064")
PRAISED = ("babps9o7h", "babps8o7h", "abas5o6h")
SYSTEMS = {"sho": "oscillator", "henon_heiles": "Hénon-Heiles system", "kepler": "Sun-Mercury system"}
CUBES = tuple(f"cubes/{system}.h5" for system in SYSTEMS)
#: Methods, their authors and their labels: the registry is not read before a statement is decided.
RIVALS = {
    "kahan": (BEFORE[2:3], "Kahan's", "s5odr4"), "blanes": (BEFORE[3:], "Blanes'", "ABA104, ABA864 and ABA1064"),
}  # fmt: skip


in_discussion = partial(result, paper="Section 5, Discussion")
in_conclusion = partial(result, paper="Section 6, Conclusion")


def _outperforms_ruth(system: str, results: Results, factor: float) -> Decision:
    curves = judging.curves_of(results, system)
    ruth, new = curves.errors(["ruth"])[0], curves.errors(NEW)
    asked = curves.compared(ruth, new, kept=new)
    worst, best = (ruth[asked.asked] / one[asked.asked] for one in (new.max(axis=0), new.min(axis=0)))
    value = f"ratio of Ruth's error to the worst new method's error {short(worst.min(), 2)} to {short(worst.max(), 2)}"
    value += f", to the best new method's error up to {short(best.max(), 2)}"
    return judging.over(asked, ruth >= factor * new.max(axis=0), value)


RUTH = tuple(
    in_discussion(
        id=f"outperform-ruth-{system.replace('_', '-')}",
        sentence="the new schemes outperforms the acclaimed stage-optimized integrator Ruth by several orders of "
        "magnitude",
        statement=f"The new schemes outperform Ruth by several orders of magnitude on the {name}",
        threshold="Ruth's maximum error is at least 100 times the maximum error of each of the four new methods in the "
        f"figures {judging.range_words('a new method')}. {judging.SEVERAL_ORDERS.words}. {judging.PERFORMANCE.brief}",
        bound=judging.SEVERAL_ORDERS.number,
        needs=(f"cubes/{system}.h5",),
    )(partial(_outperforms_ruth, system))
    for system, name in SYSTEMS.items()
)


@in_conclusion(
    sentence="the obtained integrators outperform the three stage fourth order integrator by R. Ruth",
    statement="Each of the four new methods in the figures has a smaller error than Ruth's method at equal cost",
    threshold="on each system Ruth's maximum and mean errors are above the errors of each of the four new methods in "
    f"the figures {judging.range_words('a new method')}. {judging.PERFORMANCE.brief}",
    bound=1.0,
    needs=CUBES,
)
def outperform_ruth(results: Results, factor: float) -> Decision:
    verdicts, told = _against_ruth(results, lambda ruth, worst: ruth > factor * worst)
    listed = (
        f"{name} {' and '.join(f'{short(gain.min(), 2)} to {short(gain.max(), 2)}' for gain in gains)} "
        f"at {gains[0].size} step sizes"
        for name, gains in told.items()
    )
    value = "ratio of Ruth's error to the worst new method's error, for maximum and mean errors: "
    return combined(verdicts, value + "; ".join(listed))


def _against_ruth(
    results: Results, better: Callable[[Floats, Floats], Bools]
) -> tuple[list[Verdict], dict[str, list[Floats]]]:
    """Compare Ruth's errors with the worst new errors; return verdicts, and ratios by system and measure."""
    verdicts: list[Verdict] = []
    gains: dict[str, list[Floats]] = {}
    for system, name in SYSTEMS.items():
        curves = judging.curves_of(results, system)
        new = curves.errors(NEW)
        asked = curves.compared(curves.errors(["ruth"]), new, kept=new)
        for variable in judging.MEASURES.values():
            ruth, worst = curves.errors(["ruth"], variable)[0], curves.errors(NEW, variable).max(axis=0)
            verdicts.append(judging.over(asked, better(ruth, worst)).verdict)
            gains.setdefault(name, []).append(ruth[asked.asked] / worst[asked.asked])
    return verdicts, gains


def _outperforms(names: Sequence[str], system: str, results: Results, ratio: float) -> Decision:
    curves, told = judging.curves_of(results, system), []
    asked = curves.compared(curves.errors((*names, *NEW)))
    verdicts: list[Verdict] = []
    total, every = int(asked.asked.sum()), list[int]()
    for measure, variable in judging.MEASURES.items():
        old, new = curves.errors(names, variable).min(axis=0), curves.errors(NEW, variable)
        verdicts += [judging.over(asked, one < ratio * old).verdict for one in new]
        counts = (new < old)[:, asked.asked].sum(axis=1).tolist()
        every += counts
        best = int((new.min(axis=0) < old)[asked.asked].sum())
        listed = ", ".join(f"{label(name)} {count}" for name, count in zip(NEW, counts, strict=True))
        listed = "all for each of the four" if {*counts} == {total} else f"{listed}, best of the four {best}"
        told.append(f"{measure} error {listed}")
    low, high = min(every), max(every)
    brief = f"{low} of {total}" if low == high else f"{low} to {high} of {total}"
    value = f"step sizes at which a new method has the smaller error, of {total} for {asked.words()}: "
    return combined(verdicts, value + "; ".join(told), brief)


KAHAN_AND_BLANES = tuple(
    in_conclusion(
        id=f"outperform-{rival}-{system.replace('_', '-')}",
        sentence="the obtained integrators outperform the three stage fourth order integrator by R. Ruth as well as "
        "the more optimized integrators by W. Kahan and S. Blanes",
        statement=f"The obtained integrators outperform {whose} more optimized integrators on the {name}",
        threshold="maximum and mean errors of each of the four new methods in the figures are below the errors of "
        f"{labels} {judging.range_words()}. The statement holds in part if this is true for some of the four methods, "
        f"or for one of the two errors. {judging.PERFORMANCE.brief}",
        bound=1.0,
        needs=(f"cubes/{system}.h5",),
    )(partial(_outperforms, names, system))
    for rival, (names, whose, labels) in RIVALS.items()
    for system, name in SYSTEMS.items()
)


def _favourable_to_yoshida(system: str, results: Results, ratio: float) -> Decision:
    curves, told = judging.curves_of(results, system), []
    largest = curves.errors(NEW)
    asked = curves.compared(curves.errors(["yoshida_s7o6a"]), largest, kept=largest)
    verdicts: list[Verdict] = []
    for measure, variable in judging.MEASURES.items():
        yoshida = curves.errors(["yoshida_s7o6a"], variable)[0]
        verdict, value, *_ = judging.for_larger_steps(asked, curves.errors(NEW, variable).max(axis=0) < ratio * yoshida)
        verdicts.append(verdict)
        told.append(f"{measure} error {value}")
    return combined(verdicts, f"the new methods are better by {' and by '.join(told)}")


MODERATE_STEPS = tuple(
    in_conclusion(
        id=f"yoshida-moderate-steps-{system.replace('_', '-')}",
        sentence="The obtained integrators also compare favorably with higher order integrators by H. Yoshida for "
        "moderate time steps",
        statement=f"The new methods compare favorably with Yosh s7o6 A for moderate steps on the {name}",
        threshold="maximum and mean errors of each of the four new methods in the figures are below the errors of "
        "Yosh s7o6 A at the end of the range of comparison. The range ends where the maximum error of a new method "
        f"exceeds 1 %. {judging.MODERATE.brief}. The statement holds in part if this is true over half a decade "
        "elsewhere in the range, or for one of the errors",
        bound=1.0,
        needs=(f"cubes/{system}.h5",),
    )(partial(_favourable_to_yoshida, system))
    for system, name in SYSTEMS.items()
)


@in_conclusion(
    sentence="The best performance is generally achieved by the methods BAB's9o7H, BAB's8o7H and ABAs5o6H A",
    statement="The best performance is generally achieved by BAB's9o7H, BAB's8o7H and ABAs5o6H",
    threshold="on each system one of the three methods has the smallest maximum error of the ten methods at more than "
    "half of the step sizes of the range of comparison. The same is true for the mean error. The range ends where the "
    f"maximum error of one of the three methods exceeds 1 %. {judging.GENERALLY.words}. Trained methods are newer than "
    "the paper. The value mentions them if the target trained_proof has run, and the verdict does not depend on them",
    bound=judging.GENERALLY.number,
    needs=CUBES,
    also=(TRAINED,),
)
def best_performance(results: Results, share: float) -> Decision:
    good, told = [], []
    for system, name in SYSTEMS.items():
        curves, counts = judging.curves_of(results, system), []
        praised = curves.errors(PRAISED)
        asked = curves.compared(curves.errors(BENCHMARKED), kept=praised).asked
        for variable in judging.MEASURES.values():
            others = curves.errors([one for one in BENCHMARKED if one not in PRAISED], variable)
            best = curves.errors(PRAISED, variable).min(axis=0) < others.min(axis=0)
            counts.append(int(best[asked].sum()))
        good += [count > share * int(asked.sum()) for count in counts]
        told.append(f"{name} {counts[0]} and {counts[1]} of {int(asked.sum())}")
    beside = lead_of_trained(results, PRAISED, "the three methods")
    value = "step sizes at which one of the three methods is best, by maximum and mean error: "
    return counted(good, f"{value}{', '.join(told)}{beside}")


@result(
    paper="Abstract",
    sentence="Numerical tests indicate that the integrators obtained in this paper perform significantly better than "
    "previous integrators for common Hamiltonian systems",
    statement="Each of the four new methods in the figures is significantly better than each of the six previous "
    "methods, on each of the three systems",
    threshold="on each system and in each of the 24 pairs of methods the maximum error of the new method is smaller by "
    "a tenth of a decade at more than half of the step sizes of the range of comparison. The same is true for the mean "
    f"error. {judging.SIGNIFICANTLY.brief}",
    bound=judging.SIGNIFICANTLY.number,
    needs=CUBES,
)
def significantly_better(results: Results, factor: float) -> Decision:
    good, told, brief = [], [], []
    for system, name in SYSTEMS.items():
        curves, counts = judging.curves_of(results, system), []
        asked = curves.compared(curves.errors(BENCHMARKED)).asked
        for variable in judging.MEASURES.values():
            before, new = (curves.errors(names, variable)[:, asked] for names in (BEFORE, NEW))
            pairs = [2 * int((factor * one < other).sum()) > one.size for one in new for other in before]
            good += pairs
            counts.append(sum(pairs))
        told.append(f"{name} {counts[0]} and {counts[1]} of {len(NEW) * len(BEFORE)}")
        brief.append(f"{name.removesuffix(' system')} {counts[0]} / {counts[1]}")
    value = f"pairs in which the new method is significantly better, by maximum and mean error: {', '.join(told)}"
    won = f"pairs with a better new method by maximum / mean error, of {len(NEW) * len(BEFORE)}: {', '.join(brief)}"
    return counted(good, value, won)


@in_discussion(
    sentence="All numerical tests suggest that the obtained integrators in spite of an increased number of stages "
    "greatly and consistently improve the integration accuracy and stability",
    statement="All tests suggest that the obtained integrators greatly and consistently improve the accuracy",
    threshold="on each system Ruth's maximum and mean errors are at least ten times the errors of each of the four new "
    f"methods in the figures {judging.range_words('a new method')}. {judging.GREATLY.words}. The comparison is with "
    "Ruth's method, as in the next sentence of the paper. Stability is the subject of another statement",
    bound=judging.GREATLY.number,
    needs=CUBES,
)
def greatly_and_consistently(results: Results, factor: float) -> Decision:
    verdicts, told = _against_ruth(results, lambda ruth, worst: ruth >= factor * worst)
    listed = []
    for name, gains in told.items():
        counts = " and ".join(str(int((gain >= factor).sum())) for gain in gains)
        least = " and ".join(short(float(gain.min()), 2) for gain in gains)
        listed.append(f"{name} {counts} of {gains[0].size} (smallest factors {least})")
    value = f"step sizes at which Ruth's error is at least {short(factor)} times the worst new method's error"
    return combined(verdicts, f"{value}, for maximum and mean errors: {', '.join(listed)}")


# --- Section 5: stability with large steps, kinetic energies that are not quadratic, close encounters, higher order. --

METHODS = ("ruth", *NEW)
LARGER = "is larger than Ruth's, for each of the four new methods in the figures"
#: The paper's interval of time on the oscillator.
T_END = 500.0


def _above(found: Sequence[Mapping[str, float]], value: str, ratio: float) -> Decision:
    """Compare the step sizes of the new methods with Ruth's, system by system."""
    good = [ends[name] > ratio * ends["ruth"] for ends in found for name in NEW]
    return tallied(good, "step sizes are larger than Ruth's step size", f"; {value}")


def _ends_in_words(ends: Mapping[str, float]) -> str:
    return ", ".join(f"{label(name)} {short(end) if end < inf else 'none'}" for name, end in ends.items())


def _on_each_system(
    words: str, end: Callable[[judging.Curves, Floats], float], results: Results, ratio: float
) -> Decision:
    """Compare the step sizes that ``end`` finds on curves of maximum errors."""
    found, told = [], []
    for system, name in SYSTEMS.items():
        curves = judging.curves_of(results, system)
        found.append({method: end(curves, curves.errors([method])[0]) for method in METHODS})
        told.append(f"{name} {_ends_in_words(found[-1])}{curves.unit}")
    return _above(found, f"{words}: {'; '.join(told)}", ratio)


def _of_each_method(words: str, end: Callable[[Tableau], float], results: Results, ratio: float) -> Decision:
    """Compare the step sizes that ``end`` computes from the coefficients."""
    ends = {name: end(results.method(name)) for name in METHODS}
    return _above([ends], f"{words}: {_ends_in_words(ends)}", ratio)


def _loss(curves: judging.Curves, error: Floats) -> float:
    return float(curves.x[error > judging.LOST].min(initial=inf))


@cache
def _limit(method: Tableau) -> float:
    return float(stability_limit(method)) / method.stages


@cache
def _growing(method: Tableau) -> float:
    """Return the first step size per stage at which the oscillator grows by a factor of ten in a gap of stability."""
    trace, needed = [float(c) for c in reversed(step_polynomials(method).trace)], log(judging.GREATLY.number) / T_END
    for low, high in stability_gaps(method):
        # Growth rises from the edge of a gap, and the last gap has no end. Doubles show where it may be large enough.
        taus = np.linspace(float(low), min(float(high), 1.5 * float(low)), 402)[1:-1]
        for tau in taus[np.arccosh(np.maximum(np.abs(np.polyval(trace, taus)) / 2, 1.0)) > 0.99 * needed * taus]:
            if float(growth_rate(method, tau)) / tau >= needed:
                return float(tau) / method.stages
    return inf


def _spike(curves: judging.Curves, error: Floats) -> float:
    """Return the first step size, above the range of rounding, with ten times the error of a larger step size."""
    asked = curves.compared(error, kept=np.where(np.isfinite(error), 0.0, inf))
    later = np.minimum.accumulate(error[::-1])[::-1]
    spiked = asked.asked[:-1] & (error[:-1] >= judging.GREATLY.number * later[1:])
    return float(curves.x[:-1][spiked].min(initial=float(curves.x[~np.isfinite(error)].min(initial=inf))))


#: High numerical stability has four meanings, each with its number. Step sizes per stage compare at equal cost.
highly_stable = partial(
    in_discussion,
    sentence="Optimized fourth order schemes appear to be useful for achieving high numerical stability allowing "
    "large time steps with minimal integration error",
    bound=1.0,
)
STABILITY = (
    highly_stable(
        id="stable-with-large-steps",
        statement="Large steps with small errors: the maximum error exceeds 1 % at a larger τ/s than Ruth's error",
        threshold=f"the smallest τ/s at which the maximum error exceeds 1 % {LARGER}, on each system",
        needs=CUBES,
    )(partial(_on_each_system, "τ/s at an error of 1 %", _loss)),
    highly_stable(
        id="stable-linear-limit",
        statement="Linear stability: the stability limit on the oscillator is at a larger τ/s than Ruth's limit",
        threshold=f"the smallest τ/s at which |tr K| of the step matrix K exceeds 2 {LARGER}. The limits are proved",
    )(partial(_of_each_method, "τ/s at the limit", _limit)),
    highly_stable(
        id="stable-growth",
        statement="Visible instability: an oscillator's amplitude grows tenfold at a larger τ/s than for Ruth's method",
        threshold=f"the smallest τ/s at which the step matrix grows tenfold over t = {T_END:.0f} {LARGER}. The first "
        "gap of stability, where |tr K| exceeds 2, may be too narrow for such growth",
    )(partial(_of_each_method, "τ/s at tenfold growth", _growing)),
    highly_stable(
        id="stable-first-spike",
        statement="Resonances: the first spike of the maximum error is at a larger τ/s than Ruth's first spike",
        threshold=f"the smallest τ/s with a spike {LARGER}, on each system. At a spike the maximum error is at least "
        "ten times the maximum error at a larger τ/s. If a method has no spike, the first run that diverges counts",
        needs=CUBES,
    )(partial(_on_each_system, "τ/s at the first spike", _spike)),
)


@in_discussion(
    sentence="The performance of the obtained integrators generally declines for systems where T(p) deviates "
    "significantly from a squared kinetic energy",
    statement="The performance generally declines where T deviates significantly from a squared kinetic energy",
    threshold="on a relativistic oscillator at τ/s = 0.05, the maximum error is more than 1.26 times the maximum error "
    "with the roles of T and V exchanged. With exchanged roles V is not quadratic. The ratio of the two errors exceeds "
    "Ruth's ratio. Both are true for more than half of the new methods at the amplitudes 0.1 and 1. There T deviates "
    f"from a square by 0.25 % and by a sixth. {judging.SIGNIFICANTLY.brief}. {judging.GENERALLY.words}",
    bound=judging.SIGNIFICANTLY.number,
    needs=("cubes/kinetic_energy.h5",),
)
def t_not_quadratic(results: Results, least: float) -> Decision:
    cube, good, told = results.cube("kinetic_energy"), [], []
    for name in METHODS:
        require(name in cube["integrator"].values, f"the results do not have the method {label(name)}")
    errors = cube["max_energy_error"].sel(tau_per_stage=0.05, method="nearest").sel(integrator=[*METHODS])
    ratios = errors.sel(roles="own") / errors.sel(roles="exchanged")
    for amplitude in (0.1, 1.0):
        ruth, *new = ratios.sel(amplitude=amplitude, method="nearest").values.tolist()
        good += [one > max(least, ruth) for one in new]
        listed = ", ".join(f"{label(name)} {short(one, 2)}" for name, one in zip(NEW, new, strict=True))
        told.append(f"at amplitude {short(amplitude)} {listed}, Ruth {short(ruth, 2)}")
    value = f"ratio of the error to the error with exchanged roles: {'; '.join(told)}"
    return either(sum(good) > judging.GENERALLY.number * len(good), value)


#: Force evaluations per orbit, as in the figures of Kepler maps, and eccentricities of a round and a close orbit.
EVALUATIONS, ROUND, CLOSE = 400, 0.2, 0.95


@background(
    paper="Section 5, Discussion",
    sentence="Close encounters in the gravitational N-body system inevitably cause high errors ultimately waiving "
    "symplectic properties of SIs",
    statement="Close encounters cause high errors: with fixed steps the energy of an eccentric orbit is not conserved",
    threshold=f"for each method, at {EVALUATIONS} evaluations per orbit, the relative energy error exceeds 1 within "
    f"ten periods on a Kepler orbit of eccentricity {CLOSE}. It stays below 1 % on an orbit of eccentricity {ROUND}",
    bound=judging.LOST,
    needs=("cubes/stability_kepler.h5",),
)
def close_encounters(results: Results, kept_below: float) -> Decision:
    cube = results.cube("stability_kepler")
    of_orbits = cube["energy_error"].sel(eccentricity=[ROUND, CLOSE], method="nearest").values
    places = abs(cube["evaluations_per_orbit"].values - EVALUATIONS).argmin(axis=1)
    kept, lost = zip(*(map(float, errors[place]) for errors, place in zip(of_orbits, places, strict=True)), strict=True)
    good = [one < kept_below and other == inf for one, other in zip(kept, lost, strict=True)]
    beside = f"; energy error {short(min(kept), 2)} to {short(max(kept), 2)} at eccentricity {ROUND}"
    return tallied(good, "methods lose the orbit", beside)


@background(
    paper="Section 5, Discussion",
    sentence="Higher order integrators are generally more constrained and usually involve several negative splitting "
    "coefficients with large absolute values",
    statement="Higher order integrators usually have several negative coefficients, and usually a large one",
    threshold="more than half of the registered methods of order 6 or more for any separable Hamiltonian have several "
    "negative coefficients. More than half have a large negative coefficient, which means below -1 and thus not small. "
    "The statement holds in part if one of the two is true. "
    f"{judging.SEVERAL.words}. {judging.SMALL.words}. {judging.GENERALLY.words}",
    bound=judging.GENERALLY.number,
    needs=("tables/integrators.csv",),
)
def high_order_negative(results: Results, share: float) -> Decision:
    high = {row["integrator"]: row for row in results.rows("integrators") if int(row["order"]) >= 6}
    require(high, "the table of methods has none of order 6")
    several = [int(row["negative coefficients"]) >= judging.SEVERAL.number for row in high.values()]
    most = {name: _most_negative(results.method(name)) for name in high}
    large = [one < -judging.SMALL.number for one in most.values()]
    listed = [f"{label(name)} {high[name]['negative coefficients']} and {one:.2f}" for name, one in most.items()]
    new = min(_most_negative(results.method(name)) for name in NEW)
    value = f"several in {sum(several)} of {len(high)} methods, a large one in {sum(large)}; number of negative "
    value += f"coefficients, and the most negative one: {', '.join(listed)}; in the new methods down to {new:.2f}"
    return counted([sum(good) > share * len(high) for good in (several, large)], value)


def _most_negative(method: Tableau) -> float:
    return min(float(c) for c in (*method.kick, *method.drift))
