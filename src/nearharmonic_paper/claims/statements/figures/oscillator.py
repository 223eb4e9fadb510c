"""Figures 1 and 2: the simple harmonic oscillator, its observed orders and its error terms."""

from __future__ import annotations

from typing import Any

import numpy as np

from nearharmonic.integrators.tableau import First
from nearharmonic.theory.oscillator import kappa, lambda_max, zeta
from nearharmonic_paper.claims.claim import Decision, counted, either, mathematics, result, tallied
from nearharmonic_paper.claims.judging import (
    BAND,
    GENERALLY,
    GREATLY,
    LARGE,
    NOT_SUITABLE,
    SLOPE,
    curves_of,
    large_steps,
    over,
    slopes_are,
)
from nearharmonic_paper.claims.results import Results, label, once, require, short

TERMS = ("cubes/sho_terms.h5",)
#: First moves of the ABA and of the BAB composition.
COMPOSITIONS: tuple[First, ...] = ("drift", "kick")
SIXTH = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
FOURTH = ("ruth", "s5odr4", "aba104", "aba864", "aba1064")
READS_ORDER = "The slopes of the lines read the integrator order"
#: An error term that vanishes for the true coefficients is below this for the printed ones, and any other above it.
VANISHED = 1e-30
ZERO = "a term below 10⁻³⁰ vanishes: rounded decimals leave up to 10⁻⁷³ of one, and all others are above 10⁻⁴"


FIGURE_1 = tuple(
    result(
        id=name,
        paper="Section 4.B, text to Figure 1",
        sentence=sentence,
        statement=statement,
        threshold=SLOPE,
        bound=BAND,
        needs=("cubes/sho.h5",),
    )(slopes_are("sho", orders))
    for name, sentence, statement, orders in (
        (
            "fig-1-sixth-order",
            "the integrators ABAs5o6H A, BABs7o7H, BAB's8o7H and BAB's9o7H behave as sixth order integrators",
            "ABAs5o6H, BABs7o7H, BAB's8o7H and BAB's9o7H behave as sixth order integrators on the oscillator",
            dict.fromkeys(SIXTH, 6),
        ),
        (
            "fig-1-fourth-order",
            READS_ORDER,
            f"{READS_ORDER}: four for Ruth, s5odr4, ABA104, ABA864 and ABA1064",
            dict.fromkeys(FOURTH, 4),
        ),
        (
            "fig-1-yoshida",
            READS_ORDER,
            f"{READS_ORDER}: six for Yosh s7o6 A",
            {"yoshida_s7o6a": 6},
        ),
    )
)


@mathematics(
    paper="Section 3, last paragraph",
    sentence="The objectives κ₀ and κ₁ are always 0 if Σ c_i = Σ d_i = 1",
    statement="κ₀ and κ₁ are always 0 if the coefficients of each row sum to 1",
    threshold=f"κ₀ = 0 exactly, and κ₁ vanishes, for each method and composition of Figure 2; {ZERO}",
    bound=VANISHED,
    needs=TERMS,
)
def kappa_0_and_1(results: Results, vanished: float) -> Decision:
    terms = results.cube("sho_terms")["kappa"].sel(order=1).values
    zeroth = [abs(1 - zeta(m, first=first)[0]) for m in _methods(results) for first in COMPOSITIONS]
    good = [*(term == 0 for term in zeroth), *(terms < vanished).ravel()]
    return counted(good, f"κ₀ = {short(float(max(zeroth)))}, κ₁ up to {short(float(terms.max()), 1)}")


def _methods(results: Results) -> list[Any]:
    return [results.method(str(name)) for name in results.cube("sho_terms")["integrator"].values]


@once
def _terms(results: Results, name: str, first: str | None = None) -> Any:
    """The terms of one composition as far as they reach, the method's own by default; the first at index 0."""
    first, terms = first or results.method(name).first, results.cube("sho_terms")["kappa"]
    require(name in terms["integrator"].values, f"Figure 2 of these results does not have the method {name}")
    row = terms.sel(integrator=name, first=first).values
    return row[np.isfinite(row)]


@once
def _by_parity(results: Results) -> tuple[Any, Any, Any]:
    """The even terms of the ABA and of the BAB composition, and the odd ones of both."""
    terms = results.cube("sho_terms")["kappa"]
    one, other = (terms.sel(first=first, order=terms["order"] % 2 == 0).values for first in COMPOSITIONS)
    return one, other, terms.sel(order=(terms["order"] % 2 == 1) & (terms["order"] > 3)).values


@result(
    paper="Figure 2, caption",
    sentence="Lines and markers of the same color intersect exactly at even orders",
    statement="Terms of the ABA and the BAB composition intersect exactly at even orders",
    threshold="even terms of both are equal to a unit in the last place of a double, or both below 10⁻³⁰",
    bound=VANISHED,
    needs=TERMS,
)
def fig_2_even_orders_meet(results: Results, vanished: float) -> Decision:
    one, other, odd = _by_parity(results)
    reached = np.isfinite(one) & np.isfinite(other)
    none = (one < vanished) & (other < vanished)
    same = (np.abs(one - other) <= np.spacing(np.maximum(np.abs(one), np.abs(other)))) | none
    differ = short(float(np.nanmax(np.abs(np.diff(odd, axis=1)))))
    return tallied(same[reached].tolist(), "even terms", f"; odd ones differ, by up to {differ}")


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="the obtained BAB methods have more error terms when implemented as ABA methods",
    statement="The obtained BAB methods have more error terms when implemented as ABA methods",
    threshold=f"more terms that do not vanish as ABA than as BAB, for each BAB method of Figure 2; {ZERO}",
    bound=VANISHED,
    needs=TERMS,
)
def fig_2_more_terms_as_aba(results: Results, vanished: float) -> Decision:
    names = [m.name for m in _methods(results) if m.first == "kick"]
    require(names, "Figure 2 of these results has no BAB method")
    counts = {name: [int((_terms(results, name, f) > vanished).sum()) for f in COMPOSITIONS] for name in names}
    good = [aba > bab for aba, bab in counts.values()]
    return counted(good, ", ".join(f"{label(name)} {aba} against {bab}" for name, (aba, bab) in counts.items()))


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="the seventh harmonic order of BAB's8o7H eliminates the seventh order error term of the position "
    "coordinate for the BAB implementation as opposed to the sixth harmonic order integrator ABAs5o6H A",
    statement="κ₇ vanishes for BAB's8o7H as BAB, as opposed to ABAs5o6H",
    threshold=f"κ₇ of BAB's8o7H vanishes, that of ABAs5o6H does not; {ZERO}",
    bound=VANISHED,
    needs=TERMS,
)
def fig_2_kappa_7(results: Results, vanished: float) -> Decision:
    bab, aba = _terms(results, "babps8o7h")[6], _terms(results, "abas5o6h")[6]
    return counted([bab < vanished, aba > vanished], f"{short(bab, 1)} for BAB's8o7H, {short(aba)} for ABAs5o6H")


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="The largest integer value of λ with no integration error reads the SHO integration order",
    statement="The largest λ up to which all terms vanish is the harmonic order in the name of the method",
    threshold=f"equal numbers for each of the four new methods in the figures; {ZERO}",
    bound=VANISHED,
    needs=TERMS,
)
def fig_2_reads_order(results: Results, vanished: float) -> Decision:
    good, told = [], []
    for name in SIXTH:
        last = int(np.argmax([*(_terms(results, name) >= vanished), True]))
        good.append(f"o{last}H" in label(name))
        told.append(f"{label(name)} {last}")
    return counted(good, ", ".join(told))


#: The methods of order six and more that are compositions of leapfrog steps with as few stages as solutions were found.
STAGE_OPTIMISED = ("yoshida_s7o6a", "s9odr6a", "s15odr8")


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="Stage-optimized integrators of higher orders generally have rapidly diverging higher order error "
    "contributions",
    statement="Of Yosh s7o6 A, s9odr6a and s15odr8 most have terms κ far larger than those of the new methods",
    threshold="the largest κ at least ten times that of each of the four new methods in the figures, for more than "
    f"half of Yosh s7o6 A, s9odr6a and s15odr8; {GREATLY.brief}; {GENERALLY.brief}",
    bound=GREATLY.number,
    needs=TERMS,
)
def fig_2_yoshida_diverges(results: Results, factor: float) -> Decision:
    new = {name: float(_terms(results, name).max()) for name in SIXTH}
    worst = max(new, key=new.__getitem__)
    theirs = {"yoshida_s7o6a": float(_terms(results, "yoshida_s7o6a").max())}
    for method in (results.methods[name] for name in STAGE_OPTIMISED[1:] if name in results.methods):
        theirs[method.name] = float(max(kappa(method, lambda_max(method))))
    listed = ", ".join(f"{label(name)} {short(largest)}" for name, largest in theirs.items())
    value = f"{listed}, against at most {short(new[worst])}, of {label(worst)}"
    rapid = [largest >= factor * new[worst] for largest in theirs.values()]
    return either(sum(rapid) > GENERALLY.number * len(rapid), value)


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="these integrators are not suitable for integrating the SHO with large time steps",
    statement="Stage-optimized integrators of higher order are not suitable for the oscillator with large time steps",
    threshold="the maximum error of Yosh s7o6 A, the only one of them in the figures, at least ten times that of the "
    f"best of the other nine, at every large step size; {NOT_SUITABLE.brief}; {LARGE.brief}",
    bound=NOT_SUITABLE.number,
    needs=("cubes/sho.h5",),
)
def fig_2_large_steps(results: Results, factor: float) -> Decision:
    curves = curves_of(results, "sho")
    others = (*FOURTH, *SIXTH)
    theirs, best = curves.errors(["yoshida_s7o6a"])[0], curves.errors(others).min(axis=0)
    asked = large_steps(curves, *others)
    ratio = (theirs / best)[asked.asked]
    value = f"its error over that of the best {short(ratio.min(), 2)} to {short(ratio.max(), 2)}"
    return over(asked, theirs >= factor * best, value)
