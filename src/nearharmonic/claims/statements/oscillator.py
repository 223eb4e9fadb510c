"""Figures 1 and 2: the simple harmonic oscillator, its observed orders and its error terms."""

from __future__ import annotations

from typing import Any

import numpy as np

from nearharmonic.claims.claim import Decision, claim, counted
from nearharmonic.claims.curves import FEWEST, LOST, PART, SLOPE, Curves, Range, orders, slope
from nearharmonic.claims.results import Results, Undecided, label, short
from nearharmonic.theory.oscillator import kappa, lambda_max, zeta

CUBE = ("cubes/sho.h5",)
TERMS = ("cubes/sho_terms.h5",)
SIXTH = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
FOURTH = ("ruth", "s5odr4", "aba104", "aba864", "aba1064")
#: An error term that vanishes for the true coefficients is below this for the printed ones, and any other above it.
VANISHED = 1e-30
ZERO = "a term vanishes below 10⁻³⁰: printed decimals leave up to 10⁻⁷³ of one, and the least other is above 10⁻⁴"


@claim(
    id="fig-1-sixth-order",
    paper="Section 4.B, text to Figure 1",
    statement="ABAs5o6H, BABs7o7H, BAB's8o7H and BAB's9o7H behave as sixth order integrators on the oscillator",
    threshold=SLOPE,
    needs=CUBE,
)
def fig_1_sixth_order(results: Results) -> Decision:
    return orders(Curves(results.cube("sho")), dict.fromkeys(SIXTH, 6))


@claim(
    id="fig-1-fourth-order",
    paper="Section 4.B, text to Figure 1",
    statement="The slopes of the lines read the integrator order: four for Ruth, s5odr4, ABA104, ABA864 and ABA1064",
    threshold=SLOPE,
    needs=CUBE,
)
def fig_1_fourth_order(results: Results) -> Decision:
    return orders(Curves(results.cube("sho")), dict.fromkeys(FOURTH, 4))


@claim(
    id="fig-1-yoshida",
    paper="Section 4.B, text to Figure 1",
    statement="The slopes of the lines read the integrator order: six for Yosh s7o6 A",
    threshold=SLOPE,
    needs=CUBE,
)
def fig_1_yoshida(results: Results) -> Decision:
    return orders(Curves(results.cube("sho")), {"yoshida_s7o6a": 6})


@claim(
    id="kappa-0-and-1",
    paper="Section 3, last paragraph",
    statement="κ₀ and κ₁ are always 0 if the coefficients of each row sum to 1",
    threshold=f"for each method and composition of Figure 2, whose rows sum to 1: κ₀ is 0 exactly, as the term without "
    f"τ of the step is q_a; of κ₁ {ZERO}",
    needs=TERMS,
)
def kappa_1(results: Results) -> Decision:
    terms = results.cube("sho_terms")["kappa"].sel(order=1).values
    zeroth = [abs(1 - zeta(m, first=first)[0]) for m in _methods(results) for first in ("drift", "kick")]
    good = [*(term == 0 for term in zeroth), *(terms < VANISHED).ravel()]
    return counted(good, f"κ₀ = {short(float(max(zeroth)))}, κ₁ up to {short(float(terms.max()), 1)}")


def _methods(results: Results) -> list[Any]:
    return [results.method(str(name)) for name in results.cube("sho_terms")["integrator"].values]


def _terms(results: Results, name: str, first: str | None = None) -> Any:
    """The terms of one composition as far as they reach, the method's own by default; kappa_1 at index 0."""
    terms = results.cube("sho_terms")["kappa"]
    if name not in terms["integrator"].values:
        message = f"Figure 2 of these results does not have the method {name}"
        raise Undecided(message)
    row = terms.sel(integrator=name, first=first or results.method(name).first).values
    return row[np.isfinite(row)]


@claim(
    id="fig-2-even-orders-meet",
    paper="Figure 2, caption",
    statement="Terms of the ABA and the BAB composition intersect exactly at even orders",
    threshold="equal to one unit in the last place of a double, or both vanished below 10⁻³⁰",
    needs=TERMS,
)
def fig_2_even_orders(results: Results) -> Decision:
    terms = results.cube("sho_terms")["kappa"]
    one, other = (terms.sel(first=first, order=terms["order"] % 2 == 0).values for first in ("drift", "kick"))
    reached = np.isfinite(one) & np.isfinite(other)
    vanished = (one < VANISHED) & (other < VANISHED)
    same = (np.abs(one - other) <= np.spacing(np.maximum(np.abs(one), np.abs(other)))) | vanished
    good = same[reached]
    odd = terms.sel(order=(terms["order"] % 2 == 1) & (terms["order"] > 3)).values
    value = f"{int(good.sum())} of {good.size} even terms"
    return counted(
        list(good), f"{value}; odd ones differ, by up to {short(float(np.nanmax(np.abs(np.diff(odd, axis=1)))))}"
    )


@claim(
    id="fig-2-more-terms-as-aba",
    paper="Section 4.B, text to Figure 2",
    statement="The obtained BAB methods have more error terms when implemented as ABA methods",
    threshold=f"more terms that do not vanish, for each BAB method of Figure 2; {ZERO}",
    needs=TERMS,
)
def fig_2_more_terms(results: Results) -> Decision:
    names = [m.name for m in _methods(results) if m.first == "kick"]
    counts = {name: [int((_terms(results, name, f) > VANISHED).sum()) for f in ("drift", "kick")] for name in names}
    if not counts:
        message = "Figure 2 of these results has no BAB method"
        raise Undecided(message)
    good = [aba > bab for aba, bab in counts.values()]
    return counted(good, ", ".join(f"{label(name)} {aba} against {bab}" for name, (aba, bab) in counts.items()))


@claim(
    id="fig-2-kappa-7",
    paper="Section 4.B, text to Figure 2",
    statement="κ₇ vanishes for BAB's8o7H as BAB, as opposed to ABAs5o6H",
    threshold=ZERO,
    needs=TERMS,
)
def fig_2_kappa_7(results: Results) -> Decision:
    bab, aba = _terms(results, "babps8o7h")[6], _terms(results, "abas5o6h")[6]
    return counted([bab < VANISHED, aba > VANISHED], f"{short(bab, 1)} for BAB's8o7H, {short(aba)} for ABAs5o6H")


@claim(
    id="fig-2-reads-order",
    paper="Section 4.B, text to Figure 2",
    statement="The largest λ with no integration error reads the slope of the energy error on the oscillator",
    threshold=f"the last of the terms that vanish from the first on, against the slope of Figure 1, within 0.1; {ZERO}",
    needs=(*TERMS, *CUBE),
)
def fig_2_reads_order(results: Results) -> Decision:
    curves, told, good = Curves(results.cube("sho")), [], []
    for name in (m.name for m in _methods(results) if m.name in curves.names):
        last = int(np.argmax([*(_terms(results, name) >= VANISHED), True]))
        found = slope(curves, name).value
        good.append(abs(found - last) <= 0.1)
        told.append(f"{label(name)} {last} against {found:.2f}")
    if not good:
        message = "Figures 1 and 2 of these results have no method in common"
        raise Undecided(message)
    return counted(good, f"{sum(good)} of {len(good)}: {', '.join(told)}")


#: The methods of order six and more that are compositions of leapfrog steps with as few stages as solutions were found.
STAGE_OPTIMISED = ("yoshida_s7o6a", "s9odr6a", "s15odr8")


@claim(
    id="fig-2-yoshida-diverges",
    paper="Section 4.B, text to Figure 2",
    statement="Stage-optimized integrators of higher order generally have rapidly diverging higher order terms",
    threshold="the largest term of Yosh s7o6 A, s9odr6a and s15odr8 at least ten times that of each new method; a term "
    "that a step lacks counts 1",
    needs=TERMS,
)
def fig_2_yoshida_diverges(results: Results) -> Decision:
    new = {name: float(_terms(results, name).max()) for name in SIXTH}
    worst = max(new, key=new.__getitem__)
    theirs = {"yoshida_s7o6a": float(_terms(results, "yoshida_s7o6a").max())}
    for name in STAGE_OPTIMISED[1:]:
        if name in results.methods:
            method = results.method(name)
            theirs[name] = float(max(kappa(method, lambda_max(method))))
    listed = ", ".join(f"{label(name)} {short(largest)}" for name, largest in theirs.items())
    value = f"{listed}, against at most {short(new[worst])}, of {label(worst)}"
    return counted([largest >= 10 * new[worst] for largest in theirs.values()], value)


@claim(
    id="fig-2-large-steps",
    paper="Section 4.B, text to Figure 2",
    statement="Stage-optimized integrators of higher order are not suitable for the oscillator with large time steps",
    threshold="the maximum error of Yosh s7o6 A above that of each of the other nine over the half decade of step "
    "sizes per stage that ends where the first of these passes 1 %; in part: from some step size of it on",
    needs=CUBE,
)
def fig_2_large_steps(results: Results) -> Decision:
    curves = Curves(results.cube("sho"))
    theirs, rest = curves.errors(["yoshida_s7o6a"])[0], curves.errors([*FOURTH, *SIXTH])
    end = curves.x[(rest > LOST).any(axis=0)].min(initial=np.inf)
    asked = Range(curves.x, (curves.x >= end / PART) & (curves.x < end), curves.unit)
    if asked.asked.sum() < FEWEST:
        message = "the results have fewer than three step sizes in the half decade below an error of 1 %"
        raise Undecided(message)
    worst = theirs > rest.max(axis=0)
    if worst[asked.asked].all():
        return Decision("holds", f"{asked.words()}, all {int(asked.asked.sum())} step sizes")
    low, high = asked.at_the_end(worst)
    share = f"{int((worst & asked.asked).sum())} of {int(asked.asked.sum())} step sizes of {asked.words()}"
    if high == 0:
        return Decision("fails", share)
    return Decision("holds in part", f"from τ/s = {short(low)} on; {share}")
