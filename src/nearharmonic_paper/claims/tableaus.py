"""Statements about coefficients: Table 4, size and roles of its rows, trained methods, the list of the ten methods."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import cache, partial
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from mpmath import mp, mpf

from nearharmonic.integrators import (
    BENCHMARKED,
    blanes_2013,
    forest_ruth_1990,
    kahan_li_1997,
    nielsen_2015,
    yoshida_1990,
)
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.math import pow
from nearharmonic.numerics.portable import Floats
from nearharmonic.theory.order import error_norm, harmonic_orders_of, order_of
from nearharmonic.theory.oscillator import kappa
from nearharmonic.theory.table_4 import independent
from nearharmonic_paper.claims.claim import (
    Decision,
    Results,
    Undecided,
    attribution,
    background,
    counted,
    either,
    finding,
    label,
    misprint,
    once,
    only,
    require,
    result,
    short,
    tallied,
)
from nearharmonic_paper.claims.equations import largest, solutions
from nearharmonic_paper.claims.judging import DOT, GENERALLY, GREATLY, SMALL, rank_correlation
from nearharmonic_paper.claims.splitting import leapfrogs

if TYPE_CHECKING:
    import xarray as xr


# --- Table 4: its coefficients, unique sets, solved equations, and the wrong digit. -----------------------------------

SETS = tuple(tableau.name for tableau in nielsen_2015.TABLEAUS)
FIVE_STAGES = ("abas5o6h", "abas5o6h_b", "abas5o6h_c")
UNIQUE = (*FIVE_STAGES, "babs6o7h")
in_section_4a = partial(result, paper="Section 4.A")
in_discussion = partial(result, paper="Section 5, Discussion")
#: Decimals that Table 4 prints.
DECIMALS = 76
DERIVED = ("tables/table4_derived.csv",)


def sets(results: Results) -> Iterator[Tableau]:
    return (results.method(name) for name in SETS)


@cache
def _vanish(tableau: Tableau, highest: int) -> float:
    """Return the largest of kappa_1 ... kappa_highest."""
    return float(max(kappa(tableau, highest)))


#: A unit of the 76th decimal, times the amplification of coefficient errors: l! sums of up to 2^l products, l <= 7.
PRINTED_ZERO = 1e-70
BELOW_ZERO = (
    "below 10⁻⁷⁰. Rounding to 76 decimals leaves errors of 10⁻⁷⁶, κ₇ multiplies these errors by 7!, and the rest is a "
    "safety factor"
)


@result(
    paper="Table 4 and Eq. 17",
    sentence="Solution to Eq. 10 using BAB decomposition",
    statement="κ₁ to κ_(λ_H) vanish for each of the ten sets",
    threshold=f"each of these terms is {BELOW_ZERO}",
    bound=PRINTED_ZERO,
)
def table_4_solves(results: Results, zero: float) -> Decision:
    left = {t.label: _vanish(t, t.harmonic_order or 0) for t in sets(results)}
    worst = max(left, key=left.__getitem__)
    beside = f"; largest term {short(left[worst], 2)}, of {worst}"
    return tallied((one < zero for one in left.values()), "sets", beside)


@result(
    paper="Abstract, of Table 4",
    sentence="Efficient fourth order symplectic integrators are proposed for numerical integration of separable "
    "Hamiltonian systems",
    statement="The ten sets are of fourth order",
    threshold="each set has order 4 and no higher order for any separable Hamiltonian, proved in the free Lie algebra",
)
def table_4_fourth_order(results: Results) -> Decision:
    return tallied((order_of(t, highest=5) == 4 for t in sets(results)), "sets")


@result(
    paper="Section 4.A and Abstract",
    sentence="Splitting coefficients with five to nine stages are presented in Table 4",
    statement="Splitting coefficients with five to nine stages are presented",
    threshold="the ten sets have 5, 6, 7, 8 or 9 stages, and each of these numbers occurs",
)
def table_4_stages(results: Results) -> Decision:
    found = sorted({t.stages for t in sets(results)})
    return either(found == [5, 6, 7, 8, 9], f"{', '.join(map(str, found))} stages")


@in_section_4a(
    sentence="The naming convention of the obtained methods is [scheme]s[stages]o[order]H",
    statement="The sets are named [scheme]s[stages]o[harmonic order]H",
    threshold="each name states the composition, the stages and the proved harmonic order of the position",
)
def table_4_names(results: Results) -> Decision:
    good = []
    for t in sets(results):
        scheme, stages, order = re.findall(r"^(ABA|BAB'?)s(\d)o(\d)H", t.label)[0]
        found = (t.stages, harmonic_orders_of(t).position, t.first)
        good.append(found == (int(stages), int(order), "drift" if scheme == "ABA" else "kick"))
    return tallied(good, "names")


@result(
    paper="Table 4",
    sentence="Obtained splitting coefficients with 77 digits",
    statement="The coefficients are printed with 77 digits",
    threshold="each coefficient has 76 decimals. The paper counts the 0 before the point as the 77th digit",
)
def table_4_77_digits(results: Results) -> Decision:
    values = [value for t in sets(results) for _, _, value in independent(t)]
    good = (len(value.partition(".")[2]) == DECIMALS for value in values)
    return tallied(good, f"coefficients have {DECIMALS} decimals and a 0 before the point")


def _wrong_digits(results: Results) -> tuple[list[str], int]:
    """Return the printed coefficients that differ from the derived coefficients, and the number of all coefficients."""
    rows = results.rows("table4_derived")
    return [f"{r['coefficient']} of {r['set']}" for r in rows if r["agreeing decimals"] != str(DECIMALS)], len(rows)


C3 = "c(3) of BAB's8o7H"


@result(
    paper="Table 4",
    sentence="Obtained splitting coefficients with 77 digits",
    statement=f"Each printed coefficient except {C3} is correct to its last digit",
    threshold="each coefficient differs from its reference by less than a unit of the 76th decimal. The references for "
    "the 17 coefficients of unique sets are derived from random starts. The other references are the printed sets, "
    "continued to 128 digits by Newton's method",
    needs=DERIVED,
)
def table_4_derived(results: Results) -> Decision:
    wrong, count = _wrong_digits(results)
    bad = [name for name in wrong if name != C3]
    good = count - 1 - len(bad)
    wrong_ones = f"; wrong are {', '.join(bad)}" if bad else ""
    return counted([not bad, good > 0], f"{good} of {count - 1} coefficients{wrong_ones}")


@misprint(
    paper="Table 4, BAB's8o7H",
    sentence="c(3) =-0.0149646736494517061945681450558142918831874360003431672632178480031079700216",
    statement=f"{C3} ends in 0216",
    threshold="the printed value differs by less than a unit of the 76th decimal from its reference. The reference is "
    "the printed set, continued to 128 digits by Newton's method. The continuation changes no digit of the other "
    "coefficients. A change of another coefficient by up to 12 units of its last decimal leaves the largest of κ₁ to "
    "κ₇ above 1.4 × 10⁻⁷⁴",
    needs=DERIVED,
)
def table_4_c3(results: Results) -> Decision:
    rows = [r for r in results.rows("table4_derived") if f"{r['coefficient']} of {r['set']}" == C3]
    ((printed, derived, decimals),) = [(row["printed"], row["derived"], row["agreeing decimals"]) for row in rows]
    found = derived[: len(printed)]
    method = results.method("babps8o7h")
    left = [_vanish(one, 7) for one in (method, _with_inner(method, 2, found))]
    value = (
        f"printed ...{printed[-8:]}, continued ...{found[-8:]}{_first_change(printed, found)}. With the latter value "
        f"the largest of κ₁ to κ₇ is {short(left[1], 2)} in place of {short(left[0], 2)}"
    )
    return either(decimals == str(DECIMALS), value)


def _first_change(printed: str, found: str) -> str:
    """Describe the first decimal in which two decimal fractions differ; return "" if they are equal."""
    places = [i for i, (a, b) in enumerate(zip(printed, found, strict=True)) if a != b]
    if not places:
        return ""
    i = places[0]
    return f"; decimal {i - printed.index('.')} is {found[i]}, not {printed[i]}"


def _with_inner(method: Tableau, index: int, text: str) -> Tableau:
    """Replace a coefficient in the even inner row of ``method``; the middle coefficients keep the sum 1."""
    half = [*method.inner[: len(method.inner) // 2]]
    half[index] = text
    with localcontext(prec=100):
        half[-1] = str(Decimal("0.5") - sum(map(Decimal, half[:-1]), Decimal(0)))
    row = palindrome(*half)
    return replace(method, drift=row) if method.first == "kick" else replace(method, kick=row)


@result(
    paper="Section 3, last paragraph, and Table 4",
    sentence="Four unique sets of splitting coefficients are presented in the following section",
    statement="Four of the sets are unique: ABAs5o6H A, B, C and BABs6o7H. A unique set is an isolated solution, not a "
    "member of a family",
    threshold="each set agrees in all 76 decimals with an isolated real solution that is proved to exist",
    needs=("derived/coefficients.toml",),
)
def four_unique_sets(results: Results) -> Decision:
    found = {one["name"]: one["decimals"] for one in results.derived["agreements"]}
    return tallied((found.get(name) == DECIMALS for name in UNIQUE), "sets")


COUNTS = (
    finding(
        id="five-stage-solutions",
        paper="Table 4, first and second heading",
        sentence="Unique ABAs5o6H, A, B and C",
        statement="With five stages and harmonic order six there are four real solutions; the paper presents three",
        threshold="there are four real solutions. Elimination and Sturm's theorem count them and miss none",
        needs=("tables/derived_counts.csv",),
    )(partial(solutions, 5, lambda count: count == 4, " with five stages")),
    result(
        id="six-stage-solutions",
        paper="Table 4, second heading",
        sentence="Unique BABs6o7H (more exist)",
        statement="BABs6o7H is not the only isolated solution with six stages and harmonic order seven",
        threshold="there is more than one real solution, counted by elimination and Sturm's theorem",
        needs=("tables/derived_counts.csv",),
    )(partial(solutions, 6, lambda count: count > 1, " with six stages")),
)


@in_section_4a(
    sentence="Unique solutions satisfy both the ABA and BAB decompositions",
    statement="Unique solutions satisfy both the ABA and BAB decompositions",
    threshold=f"each of κ₁ to κ_(λ_H) of both compositions is {BELOW_ZERO}",
    bound=PRINTED_ZERO,
)
def unique_sets_solve_both(results: Results, zero: float) -> Decision:
    left = {}
    for t in map(results.method, UNIQUE):
        left[t.label] = max(_vanish(t.role(first), t.harmonic_order or 0) for first in ("drift", "kick"))
    bad = ", ".join(f"{label} has an error term of {short(one, 2)}" for label, one in left.items() if one >= zero)
    return tallied((one < zero for one in left.values()), "sets", f"; {bad}" if bad else "")


def _sides(prime: bool, results: Results) -> Decision:
    """Decide whether the momentum of each BAB set, or the position of each BAB' set if ``prime``, has lower order."""
    good, told = [], []
    for t in sets(results):
        if t.first == "kick" and ("'" in t.label) == prime:
            found = harmonic_orders_of(t)
            good.append(found.position < found.momentum if prime else found.momentum < found.position)
            told.append(f"{t.label} q {found.position}, p {found.momentum}")
    return tallied(good, f"sets; harmonic orders: {'; '.join(told)}")


SIDES = (
    in_section_4a(
        id="bab-leaves-p",
        sentence="the error of p_(s+1) remains unaddressed for the BAB solution",
        statement="In a BAB set the momentum has a lower harmonic order than the position",
        threshold="for each BAB set of Table 4 the proved harmonic order of p is lower than the order of q",
    )(partial(_sides, False)),
    in_section_4a(
        id="bab-prime-leaves-q",
        sentence="as opposed to BAB' solution where the error of q_(s+1) remains unaddressed",
        statement="In a BAB' set the position has a lower harmonic order than the momentum",
        threshold="for each BAB' set of Table 4 the proved harmonic order of q is lower than the order of p. BAB's7o6H "
        "is no evidence, because terms of even order are equal for q and p",
    )(partial(_sides, True)),
)


# --- Size of the coefficients of Table 4, and thus of the substeps. ---------------------------------------------------


def _size(tableau: Tableau) -> float:
    return largest(*tableau.kick, *tableau.drift)


near_forward = result(
    id="near-forward",
    paper="Section 1, last paragraph",
    sentence="The presented splitting coefficients generally have small absolute values and are therefore referred "
    "to as near-forward SIs",
    statement="The presented coefficients generally have small absolute values",
    threshold=f"more than half of the ten sets have no coefficient above 1. {SMALL.words}. {GENERALLY.words}",
    bound=SMALL.number,
)(lambda results, small: either(*_small(results, small)))


@in_discussion(
    sentence="BABs7o7H and other splitting coefficients obtained in this paper generally perform small near-forward "
    "steps",
    statement="BABs7o7H and the other sets generally perform small substeps",
    threshold=f"BABs7o7H and more than half of the ten sets have no coefficient above 1. {SMALL.words}. "
    f"{GENERALLY.words}",
    bound=SMALL.number,
)
def small_near_forward_steps(results: Results, small: float) -> Decision:
    most, value = _small(results, small)
    return counted([_size(results.method("babs7o7h")) <= small, most], value)


def _small(results: Results, small: float) -> tuple[bool, str]:
    """Return True if the sets generally have small coefficients, and the largest coefficients in words."""
    others = ", ".join(f"{label(n)} {short(_size(results.method(n)))}" for n in ("ruth", "yoshida_s7o6a", "s5odr4"))
    sizes = sorted((_size(t), t.label) for t in sets(results))
    good = [size <= small for size, _ in sizes]
    least, most = (f"{short(size)} ({name})" for size, name in (sizes[0], sizes[-1]))
    value = f"{sum(good)} of {len(good)} sets; largest coefficient {least} to {most}; for comparison {others}"
    return sum(good) > GENERALLY.number * len(good), value


@in_discussion(
    sentence="some of the methods presented in Table 4 only have small coefficients for either d or c",
    statement="Some of the methods of Table 4 only have small coefficients for either d or c",
    threshold="in at least one set the largest coefficient of one row is at most half the largest of the other row",
    bound=2.0,
)
def small_coefficients_of_one_row(results: Results, ratio: float) -> Decision:
    told = []
    for t in sets(results):
        d, c = largest(*t.outer), largest(*t.inner)
        if max(c, d) >= ratio * min(c, d):
            told.append(f"{t.label} {'c/d' if c > d else 'd/c'} = {short(max(c, d) / min(c, d), 2)}")
    return either(bool(told), f"{len(told)} sets; ratio of largest c and d: {', '.join(told)}" if told else "no set")


# --- Statements that methods trained by the energy error affect. ------------------------------------------------------

TRAINED = "cubes/trained.h5"
#: Names in the cube of the ensembles of random potentials with the widest band of strengths.
ENSEMBLES = ("d = 2, 0.01 to 0.5", "d = 3, 0.01 to 0.5")
ENSEMBLE_WORDS = "random potentials with two and three coordinates and strengths of 0.01 to 0.5"
#: Half way from no relation to a strict relation.
RELATED = 0.5
#: A random order of this number of methods reaches RELATED in one of twenty cases; fewer methods reach it more often.
FEWEST_METHODS = 12


def errors_on_random_potentials(results: Results) -> xr.DataArray:
    """Return means of log10 of the maximum error (integrator, point) on both ensembles, at ``tau_per_stage``."""
    cube = results.cube("trained")
    for name in ENSEMBLES:
        require(name in cube["ensemble"].values, f"the results do not have the random potentials {name}")
    # Methods with modified potentials, which spend gradients on small coefficients, are no methods of the statements.
    both = cube.sel(ensemble=list(ENSEMBLES))
    tau = both["tau_per_stage"].values[0]
    errors = both["mean_log_error"].mean("ensemble").transpose("integrator", "point")
    errors = errors.assign_coords(tau_per_stage=("point", tau), kind=("integrator", both["kind"].values))
    return errors.isel(point=np.isfinite(tau))  # other ensembles may have more step sizes


def lead_of_trained(results: Results, names: Sequence[str], what: str) -> str:
    """Describe where trained methods have smaller errors than ``names``, called ``what``; "" without results."""
    if not results.has(TRAINED):
        return ""
    try:
        errors = errors_on_random_potentials(results)
    except Undecided:
        return ""
    trained = errors[errors["kind"].values == "trained"]
    if not trained.size or not set(names) <= set(errors["integrator"].values):
        return ""
    lead = (errors.sel(integrator=list(names)).min("integrator") - trained.min("integrator")).values
    low, high = short(lead.min(), 2), short(lead.max(), 2)
    return (
        f". Outside the paper, on {ENSEMBLE_WORDS}, methods trained on other random potentials have smaller errors "
        f"than {what} at {(lead > 0).sum()} of {lead.size} step sizes, the best one by {low} to {high} decades"
    )


@background(
    paper="Section 1",
    sentence="To construct more efficient high order SIs it has been proposed that the absolute value of negative "
    "coefficients and the sum of positive coefficients should be minimized",
    statement="Smaller negative coefficients and a smaller sum of positive coefficients give smaller errors",
    threshold="Spearman's rank correlation between the sum of absolute coefficients and the mean error is at least "
    f"{RELATED} at each τ/s. It includes all registered methods of order four or more without the force gradient, on "
    f"{ENSEMBLE_WORDS}. Such a correlation is half way from no relation to a strict relation, and {FEWEST_METHODS} "
    "methods in random order reach it in one of twenty cases. Each row sums to 1, so the negative coefficients, the "
    "positive coefficients and the absolute values rank the methods alike",
    bound=RELATED,
    needs=(TRAINED,),
)
def minimised_coefficients(results: Results, related: float) -> Decision:
    every = errors_on_random_potentials(results)
    errors = every[[results.methods[name].order >= 4 for name in every["integrator"].values]]
    methods, x = [results.methods[name] for name in errors["integrator"].values], errors["tau_per_stage"].values
    known = len(methods) >= FEWEST_METHODS and x.size
    require(known, f"the results have fewer than {FEWEST_METHODS} methods of order four or more, or no step size")
    sums = np.array([sum(abs(float(c)) for c in (*one.kick, *one.drift)) for one in methods])
    found, fourth = _correlation(sums, errors.values), np.array([one.order == 4 for one in methods])
    told = [f"rank correlation {short(found[0], 2)} at τ/s = {short(x[0])} to {short(found[-1], 2)} at {short(x[-1])}"]
    good = found >= related
    told.append(f"{short(related, 2)} or more at {good.sum()} of {good.size} step sizes")
    if fourth.sum() >= FEWEST_METHODS:
        among = _correlation(sums[fourth], errors.values[fourth])
        told.append(f"{short(among.min(), 2)} to {short(among.max(), 2)} for methods of order four alone")
    return counted(good.tolist(), "; ".join([*told, *_leaders(errors, sums)]))


def _correlation(sums: Floats, mean_log: Floats) -> Floats:
    return rank_correlation(np.broadcast_to(sums[:, None], mean_log.shape), mean_log)


def _leaders(errors: xr.DataArray, sums: Floats) -> Iterator[str]:
    """Describe the methods with the smallest errors and their sums, and the errors of the method with the least sum."""
    names, x = errors["integrator"].values.tolist(), errors["tau_per_stage"].values
    leaders, led = errors.values.argmin(axis=0).tolist(), []
    for best, points in groupby(range(len(leaders)), leaders.__getitem__):
        first, *_, last = [short(float(x[i])) for i in points] * 2
        led.append(f"{label(names[best])} ({short(float(sums[best]))}) at {' to '.join(dict.fromkeys((first, last)))}")
    yield f"methods with the smallest error, and their sums: {', '.join(led)}"
    small = int(sums.argmin())
    ratios = pow(10.0, errors.values[small] - errors.values.min(axis=0))
    of = f"{short(sums[small])} ({label(names[small])})"
    yield f"the smallest sum is {of}, with {short(ratios.min())} to {short(ratios.max())} times the smallest error"


# --- Roles of the rows of Table 4, and their effect on the errors. ----------------------------------------------------

TABLES = ("tables/derived_errors.csv", "tables/derived_solutions.csv")
#: The first d that Table 4 prints for each set with five stages.
PRINTED_D1 = {"abas5o6h": "0.15585935", "abas5o6h_b": "0.40201960", "abas5o6h_c": "0.18685656"}


@misprint(
    paper="Section 2, above Table 1, and Table 4",
    sentence="the c and d coefficients are consistently used in connection with the ∂T/∂p and ∂V/∂q term respectively",
    statement="In Table 4 c always multiplies ∂T/∂p, and d always multiplies ∂V/∂q",
    threshold="d(1) is the first kick of each ABA set. By Table 1 an ABA method has one c more than d. The sets with "
    "five stages are printed with six d and five c",
)
def table_4_columns(results: Results) -> Decision:
    rows = {name: results.method(name).kick for name in PRINTED_D1}
    good = [rows[name][0].startswith(first) for name, first in PRINTED_D1.items()]
    return counted(good, f"{sum(good)} of {len(good)} sets; as ABA they have {len(rows['abas5o6h'])} kicks, not six")


@in_discussion(
    sentence="the integrator performance may change drastically if the roles of T and V are switched",
    statement="The performance may change drastically if the roles of T and V are switched",
    threshold="the maximum error of ABAs5o6H on the Hénon-Heiles system is at least ten times larger with T and V "
    f"exchanged, at each of three τ/s. {GREATLY.words}",
    bound=GREATLY.number,
    needs=TABLES,
)
def roles_switched(results: Results, factor: float) -> Decision:
    ratios = _kick_over_drift(results, "abas5o6h")
    listed = ", ".join(f"{short(ratio)} at τ/s = {tau}" for tau, ratio in ratios.items())
    return counted([ratio >= factor for ratio in ratios.values()], f"ratio of the errors: {listed}")


@in_section_4a(
    sentence="the performance of the presented solutions depends on the applied scheme",
    statement="The performance of unique solutions depends on the applied scheme",
    threshold="on the Hénon-Heiles system the maximum errors of ABAs5o6H A, B and C as ABA and as BAB differ by at "
    "least a tenth of a decade, at each of three τ/s. Such a difference is visible in a figure",
    bound=DOT,
    needs=TABLES,
)
def performance_depends_on_scheme(results: Results, dot: float) -> Decision:
    good, told = [], []
    for name in FIVE_STAGES:
        ratios = _kick_over_drift(results, name).values()
        good += [max(ratio, 1 / ratio) >= dot for ratio in ratios]
        told.append(f"{label(name)} {short(min(ratios), 2)} to {short(max(ratios), 2)}")
    return counted(good, f"ratio of the error as BAB to the error as ABA: {', '.join(told)}")


def _kick_over_drift(results: Results, name: str) -> dict[str, float]:
    """Return the ratio of the maximum errors of a set with five stages, kick first to drift first, by tau/s."""
    start = f"{float(results.method(name).outer[0]):.8f}"
    found = [
        row["solution"]
        for row in results.rows("derived_solutions")
        if row["stages"] == "5" and row["half of the outer row"].startswith(start)
    ]
    require(found, f"the derived solutions lack {label(name)}")
    errors = {
        (row["first"], row["tau/s"]): float(row["max error, Henon-Heiles"])
        for row in results.rows("derived_errors")
        if row["solution"] == found[0]
    }
    return {tau: errors["kick", tau] / error for (first, tau), error in errors.items() if first == "drift"}


# --- Section 4.B: the list of the ten methods, double precision and compensated summation. ----------------------------

#: The modules of the ten methods except Nielsen's: the digest of the job covers their declarations.
SOURCES = (blanes_2013, forest_ruth_1990, kahan_li_1997, yoshida_1990)

in_list = partial(background, paper="Section 4.B, list of the ten")
#: Stages in the printed list.
LISTED = {
    "ruth": 3, "s5odr4": 5, "aba104": 7, "aba864": 7, "aba1064": 8, "yoshida_s7o6a": 7, "abas5o6h": 5, "babs7o7h": 7,
    "babps8o7h": 7, "babps9o7h": 9,
}  # fmt: skip
GENERALISED = {"aba104": "(10, 4)", "aba864": "(8, 6, 4)", "aba1064": "(10, 6, 4)"}

#: Yoshida's solutions B and C for seven stages, his Table 1, outer weights w_3, w_2, w_1.
YOSHIDA_TABLE_1 = {
    "B": ("1.43984816797678", "0.00426068187079180", "-2.13228522200144"),
    "C": ("1.44778256239930", "-2.14403531630539", "0.00152886228424922"),
}


@in_list(
    sentence="The following 10 symmetric SIs are benchmarked",
    statement="All of the ten methods except BAB's8o7H have the listed number of stages",
    threshold="the listed number is the number of coefficients in the shorter row",
)
def listed_stages(results: Results) -> Decision:
    found = {name: results.method(name).stages for name in LISTED if name != "babps8o7h"}
    bad = [f"{label(name)} has {found[name]}, not {LISTED[name]}" for name in found if found[name] != LISTED[name]]
    good = len(found) - len(bad)
    return counted([good > 0, not bad], f"{good} of {len(found)} methods" + (f"; {', '.join(bad)}" if bad else ""))


@misprint(
    paper="Section 4.B, list of the ten",
    sentence="BAB's8o7H [BAB] 7-stage, 4th order",
    statement="BAB's8o7H has seven stages",
    threshold="the shorter row has as many coefficients. The name of the method says eight stages",
)
def listed_stages_babps8o7h(results: Results) -> Decision:
    stages = results.method("babps8o7h").stages
    return either(stages == LISTED["babps8o7h"], f"{stages} stages")


@in_list(
    sentence="Yosh s7o6 A [ABA] 7-stage, 6th order",
    statement="Yosh s7o6 A has order six, and the other methods have order four",
    threshold="these orders for any separable Hamiltonian are proved in the free Lie algebra",
)
def listed_orders(results: Results) -> Decision:
    good = [order_of(results.method(name), highest=7) == (6 if name == "yoshida_s7o6a" else 4) for name in BENCHMARKED]
    return counted(good, f"{sum(good)} of 10 methods")


@in_list(
    sentence="ABA864 [ABA] 7-stage, 8-6-4 generalized order",
    statement="ABA104, ABA864 and ABA1064 are of generalized order 10-4, 8-6-4 and 10-6-4",
    threshold="these generalised orders are proved in the free Lie algebra",
    needs=("tables/integrators.csv",),
)
def listed_generalised_orders(results: Results) -> Decision:
    rows = results.rows("integrators")
    found = {name: only(rows, "integrator", name)["generalised order"] for name in GENERALISED}
    good = [found[name] == expected for name, expected in GENERALISED.items()]
    return counted(good, ", ".join(f"{label(name)} {order}" for name, order in found.items()))


#: Weights of s5odr4 in 20 decimals, as printed in programs that use it: the outer four, and the middle one.
S5ODR4 = ("0.41449077179437573714", "-0.65796308717750294857")


@attribution(
    paper="Abstract and Section 4.B, list of the ten",
    sentence="acclaimed integrators composed by S. Blanes et al. (2013), W. Kahan et al. (1999) and H. Yoshida (1990)",
    statement="s5odr4 was first composed by Kahan",
    threshold="the weights of s5odr4, in 20 decimals and in the runs, differ by more than a unit of the last decimal "
    "from Suzuki's weights (1990), four times 1/(4 - 4^(1/3)). The name s5odr4 is by Kahan and Li (1997), cited in the "
    "list",
    bound=1e-20,
)
def s5odr4_of_kahan(results: Results, unit: float) -> Decision:
    with mp.workdps(30):
        weight = 1 / (4 - mp.cbrt(4))
        suzuki = [weight, weight, 1 - 4 * weight, weight, weight]
        printed, middle = map(mpf, S5ODR4)
        rows = [[printed, printed, middle, printed, printed], list(map(mpf, results.method("s5odr4").inner))]
        off = [float(max(abs(c - w) for c, w in zip(row, suzuki, strict=True))) for row in rows]
    value = f"the weights are Suzuki's within {short(off[0], 1)} as printed, and within {short(off[1], 1)} in the runs"
    return either(max(off) > unit, value)


@background(
    paper="Section 4.B, below the list",
    sentence="Yosh s7o6 A yields the smallest errors of the three stage-optimized sixth order integrators presented by "
    "[Yoshida]",
    statement="Of Yoshida's three methods with seven stages, Yosh s7o6 A yields the smallest errors",
    threshold="the norm of the leading error term, of degree 7 in the Lyndon basis, is smaller for A than for B and C",
    bound=1.0,
)
def yoshida_a_smallest(results: Results, ratio: float) -> Decision:
    norms = _norms(results)
    listed = ", ".join(f"{letter} {short(norm)}" for letter, norm in norms.items())
    return either(norms["A"] < ratio * min(norms[letter] for letter in YOSHIDA_TABLE_1), f"norms: {listed}")


@once
def _norms(results: Results) -> dict[str, float]:
    methods = {"A": results.method("yoshida_s7o6a")} | {letter: composed(letter) for letter in YOSHIDA_TABLE_1}
    return {letter: error_norm(method, 7) for letter, method in methods.items()}


def composed(letter: str) -> Tableau:
    """Compose seven leapfrog steps with the weights of one of Yoshida's solutions."""
    with mp.workdps(30):
        outer = [mpf(w) for w in YOSHIDA_TABLE_1[letter]]
        weights = [*outer, 1 - 2 * sum(outer), *reversed(outer)]
        return leapfrogs(weights, name=f"yoshida_s7o6{letter.lower()}", label=f"Yosh s7o6 {letter}", order=6, digits=14)


#: Half the distance of doubles at 1: the largest change by one rounding.
UNIT = float(np.finfo(float).eps / 2)


@background(
    paper="Section 4.B, below the list",
    sentence="Compensated summation drastically reduces truncation errors for long-term symplectic integration",
    statement="Compensated summation drastically reduces rounding errors in long integrations",
    threshold="for each method the root mean square of the energy error by rounding is at least ten times larger with "
    "plain sums than with compensated sums. The ratio is a median over the last 20 samples. "
    f"{GREATLY.words}. The paper calls rounding errors truncation errors",
    bound=GREATLY.number,
    needs=("cubes/stability_rounding.h5",),
)
def compensated_summation(results: Results, factor: float) -> Decision:
    cube = results.cube("stability_rounding")
    rms = cube["energy_error_rms"].isel(sample=slice(-20, None))
    gains = (rms.sel(source="plain") / rms.sel(source="compensated")).median("sample").values
    worst = label(str(cube["integrator"].values[gains.argmin()]))
    told = f"; ratios {short(gains.min(), 2)} ({worst}) to {short(gains.max(), 2)}"
    # Number, length and steps of the runs, if the cube has them.
    told += f"; {cube.sizes['orbit']} Kepler orbits" if "orbit" in cube.sizes else ""
    if "time" in cube:
        ends = cube["time"].values[:, -1]
        told += f" of {ends.min():.0f} to {ends.max():.0f} periods"
    steps = json.loads(cube.attrs.get("settings", "{}")).get("settings", {}).get("steps")
    return tallied((gains >= factor).tolist(), "methods", told + (f" in {steps} steps" if steps else ""))


@finding(
    paper="Figure 1, dashed lines; the statement is this project's",
    sentence="The dashed lines show benchmark profiles for integrators of corresponding color using extended precision",
    statement="Double precision with compensated summation agrees with extended precision down to its rounding floor",
    threshold="maximum errors in double and extended precision differ by at most 10 roundings of a double, 1.1 × "
    "10⁻¹⁵, at every step size with both precisions. Energies are of order 1, and an energy takes five roundings",
    bound=10.0,
    needs=("cubes/sho.h5",),
)
def floor_of_double(results: Results, roundings: float) -> Decision:
    cube = results.cube("sho")
    require("extended" in cube["precision"].values, "the config requests no extended precision on the oscillator")
    double, extended = (cube["max_energy_error"].sel(precision=one).values for one in ("double", "extended"))
    known = np.isfinite(double) & np.isfinite(extended)
    off = np.abs(double[known] - extended[known])
    require(off.size, "no run of the oscillator in extended precision is known")
    floor = double[known & (extended < UNIT)]
    beside = f", largest difference {short(off.max(), 2)}"
    if floor.size:
        beside += f"; rounding floor of the double curves {short(floor.min(), 2)} to {short(floor.max(), 2)}"
    return tallied((off <= roundings * UNIT).tolist(), "runs", beside)
