"""Abstract, discussion and conclusion: comparison of the new methods with previous ones, system by system."""

from __future__ import annotations

from collections.abc import Callable

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic_paper.claims.claim import Claim, Decision, Verdict, combined, counted, result
from nearharmonic_paper.claims.judging import (
    GENERALLY,
    GREATLY,
    MEASURES,
    MODERATE,
    PERFORMANCE,
    SEVERAL_ORDERS,
    SIGNIFICANTLY,
    curves_of,
    for_larger_steps,
    over,
    range_words,
)
from nearharmonic_paper.claims.results import Results, label, short
from nearharmonic_paper.claims.statements.tableaus.trained import TRAINED, lead_of_trained

NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
BEFORE = ("ruth", "yoshida_s7o6a", "s5odr4", "aba104", "aba864", "aba1064")
PRAISED = ("babps9o7h", "babps8o7h", "abas5o6h")
SYSTEMS = {"sho": "oscillator", "henon_heiles": "Hénon-Heiles system", "kepler": "Sun-Mercury system"}
CUBES = tuple(f"cubes/{system}.h5" for system in SYSTEMS)
#: Methods, whose they are, and their labels: the registry is not asked before a statement is decided.
RIVALS = {
    "kahan": (BEFORE[2:3], "of Kahan", "s5odr4"), "blanes": (BEFORE[3:], "of Blanes", "ABA104, ABA864 and ABA1064"),
}  # fmt: skip


def _outperforms_ruth(system: str) -> Claim:
    @result(
        id=f"outperform-ruth-{system.replace('_', '-')}",
        paper="Section 5, Discussion",
        sentence="the new schemes outperforms the acclaimed stage-optimized integrator Ruth by several orders of "
        "magnitude",
        statement=f"The new schemes outperform Ruth by several orders of magnitude, on the {SYSTEMS[system]}",
        threshold="Ruth's maximum error at least 100 times that of each of the four new methods in the figures "
        f"{range_words('a new one')}; {SEVERAL_ORDERS.brief}; {PERFORMANCE.brief}",
        bound=SEVERAL_ORDERS.number,
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results, factor: float) -> Decision:
        curves = curves_of(results, system)
        ruth, new = curves.errors(["ruth"])[0], curves.errors(NEW)
        asked = curves.compared(ruth, new, kept=new)
        worst, best = (ruth[asked.asked] / one[asked.asked] for one in (new.max(axis=0), new.min(axis=0)))
        value = f"Ruth's error over that of the worst new method {short(worst.min(), 2)} to {short(worst.max(), 2)}"
        return over(asked, ruth >= factor * new.max(axis=0), f"{value}, over the best up to {short(best.max(), 2)}")

    return decide


RUTH = tuple(map(_outperforms_ruth, SYSTEMS))


@result(
    paper="Section 6, Conclusion",
    sentence="the obtained integrators outperform the three stage fourth order integrator by R. Ruth",
    statement="Each of the four new methods of the figures has a smaller error than Ruth's at equal cost",
    threshold="Ruth's maximum and mean error above those of each of the four new methods in the figures, on each "
    f"system, {range_words('a new one')}; {PERFORMANCE.brief}",
    bound=1.0,
    needs=CUBES,
)
def outperform_ruth(results: Results, factor: float) -> Decision:
    verdicts, told = _against_ruth(
        results, lambda ruth, worst: ruth > factor * worst,
        lambda gain: f"{short(gain.min(), 2)} to {short(gain.max(), 2)}", "at {} step sizes",
    )  # fmt: skip
    return combined(verdicts, f"Ruth's error over that of the worst new method, maximum and mean: {told}")


def _against_ruth(
    results: Results, better: Callable[[Floats, Floats], Bools], says: Callable[[Floats], str], count: str
) -> tuple[list[Verdict], str]:
    """Compare Ruth's errors with the worst of the new ones; return verdicts, and what is said of the gains."""
    verdicts: list[Verdict] = []
    told = []
    for system, name in SYSTEMS.items():
        curves, gains = curves_of(results, system), []
        new = curves.errors(NEW)
        asked = curves.compared(curves.errors(["ruth"]), new, kept=new)
        for variable in MEASURES.values():
            ruth, worst = curves.errors(["ruth"], variable)[0], curves.errors(NEW, variable).max(axis=0)
            verdicts.append(over(asked, better(ruth, worst)).verdict)
            gains.append(says(ruth[asked.asked] / worst[asked.asked]))
        told.append(f"{name} {gains[0]} and {gains[1]} {count.format(int(asked.asked.sum()))}")
    return verdicts, ", ".join(told)


def _outperforms(rival: str, system: str) -> Claim:
    names, whose, labels = RIVALS[rival]

    @result(
        id=f"outperform-{rival}-{system.replace('_', '-')}",
        paper="Section 6, Conclusion",
        sentence="the obtained integrators outperform the three stage fourth order integrator by R. Ruth as well as "
        "the more optimized integrators by W. Kahan and S. Blanes",
        statement=f"The obtained integrators outperform the more optimized ones {whose}, on the {SYSTEMS[system]}",
        threshold="maximum and mean error of each of the four new methods in the figures below those of "
        f"{labels} {range_words()}; in part: also for some of the four, or for one of the two errors; "
        f"{PERFORMANCE.brief}",
        bound=1.0,
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results, ratio: float) -> Decision:
        curves, told = curves_of(results, system), []
        asked = curves.compared(curves.errors((*names, *NEW)))
        verdicts: list[Verdict] = []
        for measure, variable in MEASURES.items():
            old, new = curves.errors(names, variable).min(axis=0), curves.errors(NEW, variable)
            verdicts += [over(asked, one < ratio * old).verdict for one in new]
            counts = {label(name): int((one < old)[asked.asked].sum()) for name, one in zip(NEW, new, strict=True)}
            best = int((new.min(axis=0) < old)[asked.asked].sum())
            listed = ", ".join(f"{name} {count}" for name, count in counts.items())
            every = set(counts.values()) == {int(asked.asked.sum())}
            told.append(f"{measure} error " + ("each at all" if every else f"{listed}, the best of them {best}"))
        total = int(asked.asked.sum())
        return combined(verdicts, f"ahead at step sizes, of {total}: {'; '.join(told)}; {asked.words()}")

    return decide


KAHAN_AND_BLANES = tuple(_outperforms(rival, system) for rival in RIVALS for system in SYSTEMS)


def _favourable_to_yoshida(system: str) -> Claim:
    @result(
        id=f"yoshida-moderate-steps-{system.replace('_', '-')}",
        paper="Section 6, Conclusion",
        sentence="The obtained integrators also compare favorably with higher order integrators by H. Yoshida for "
        "moderate time steps",
        statement=f"The new methods compare favorably with Yosh s7o6 A for moderate steps, on the {SYSTEMS[system]}",
        threshold="maximum and mean error of each of the four new methods in the figures below those of Yosh s7o6 A at "
        "the end of the range of comparison, which is where the maximum error of a new one passes 1 %; "
        f"{MODERATE.brief}; in part: over half a decade that ends before, or for one of the errors",
        bound=1.0,
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results, ratio: float) -> Decision:
        curves, told = curves_of(results, system), []
        largest = curves.errors(NEW)
        asked = curves.compared(curves.errors(["yoshida_s7o6a"]), largest, kept=largest)
        verdicts: list[Verdict] = []
        for measure, variable in MEASURES.items():
            yoshida = curves.errors(["yoshida_s7o6a"], variable)[0]
            below = curves.errors(NEW, variable).max(axis=0) < ratio * yoshida
            verdict, value, _ = for_larger_steps(asked, below)
            verdicts.append(verdict)
            told.append(f"{measure} error {value}")
        return combined(verdicts, "; ".join(told))

    return decide


MODERATE_STEPS = tuple(map(_favourable_to_yoshida, SYSTEMS))


@result(
    paper="Section 6, Conclusion",
    sentence="The best performance is generally achieved by the methods BAB's9o7H, BAB's8o7H and ABAs5o6H A",
    statement="The best performance is generally achieved by BAB's9o7H, BAB's8o7H and ABAs5o6H",
    threshold="the smallest maximum error of the ten is that of one of the three at more than half of the step sizes "
    "of the range of comparison, up to where that of one of the three passes 1 %, on each system; and likewise the "
    f"smallest mean error; {GENERALLY.brief}. Trained methods came later: the value tells of them if the target "
    "trained_proof has run, the verdict does not depend on them",
    bound=GENERALLY.number,
    needs=CUBES,
    also=(TRAINED,),
)
def best_performance(results: Results, share: float) -> Decision:
    good, told = [], []
    for system, name in SYSTEMS.items():
        curves, counts = curves_of(results, system), []
        praised = curves.errors(PRAISED)
        asked = curves.compared(curves.errors(BENCHMARKED), kept=praised).asked
        for variable in MEASURES.values():
            others = curves.errors([one for one in BENCHMARKED if one not in PRAISED], variable)
            best = curves.errors(PRAISED, variable).min(axis=0) < others.min(axis=0)
            counts.append(int(best[asked].sum()))
        good += [count > share * int(asked.sum()) for count in counts]
        told.append(f"{name} {counts[0]} and {counts[1]} of {int(asked.sum())}")
    beside = lead_of_trained(results, PRAISED, "the three")
    return counted(good, f"best at step sizes, by maximum and mean error: {', '.join(told)}{beside}")


@result(
    paper="Abstract",
    sentence="Numerical tests indicate that the integrators obtained in this paper perform significantly better than "
    "previous integrators for common Hamiltonian systems",
    statement="Each of the four new methods of the figures is significantly better than each of the six previous ones, "
    "on each of the three systems",
    threshold="in each of the 24 pairs the error of the new method is smaller by a tenth of a decade at more than half "
    "of the step sizes of the range of comparison, on each system, by the maximum and by the mean; "
    f"{SIGNIFICANTLY.brief}",
    bound=SIGNIFICANTLY.number,
    needs=CUBES,
)
def significantly_better(results: Results, factor: float) -> Decision:
    good, told = [], []
    for system, name in SYSTEMS.items():
        curves, counts = curves_of(results, system), []
        asked = curves.compared(curves.errors(BENCHMARKED)).asked
        for variable in MEASURES.values():
            before, new = (curves.errors(names, variable)[:, asked] for names in (BEFORE, NEW))
            pairs = [2 * int((factor * one < other).sum()) > one.size for one in new for other in before]
            good += pairs
            counts.append(sum(pairs))
        told.append(f"{name} {counts[0]} and {counts[1]} of {len(NEW) * len(BEFORE)}")
    return counted(good, f"pairs with the new method ahead, by maximum and mean error: {', '.join(told)}")


@result(
    paper="Section 5, Discussion",
    sentence="All numerical tests suggest that the obtained integrators in spite of an increased number of stages "
    "greatly and consistently improve the integration accuracy and stability",
    statement="All tests suggest that the obtained integrators greatly and consistently improve the accuracy",
    threshold="Ruth's maximum and mean error, to which the next sentence compares, at least ten times those of each of "
    f"the four new methods in the figures, on each system, {range_words('a new one')}; {GREATLY.brief}; stability is "
    "the subject of another sentence",
    bound=GREATLY.number,
    needs=CUBES,
)
def greatly_and_consistently(results: Results, factor: float) -> Decision:
    verdicts, told = _against_ruth(
        results, lambda ruth, worst: ruth >= factor * worst,
        lambda gain: f"{int((gain >= factor).sum())} (least gain {short(float(gain.min()), 2)})", "of {}",
    )  # fmt: skip
    gained = f"the worst gains {short(factor)} or more at step sizes, by maximum and mean error"
    return combined(verdicts, f"{gained}: {told}")
