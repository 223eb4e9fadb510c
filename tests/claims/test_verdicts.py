"""Every verdict can be turned: each statement, its verdict on sound results, a change of these, its verdict then."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from nearharmonic.claims.statements import henon_heiles, kepler, methods
from nearharmonic.claims.table import CLAIMS
from nearharmonic.exact.decimals import fixed_point
from nearharmonic.integrators.tableau import Tableau, palindrome
from sound_results import NEW, sound_results, stand_in

HOLDS, PART, FAILS = "holds", "holds in part", "fails"


def scaled(system, factor, *names, variable="max_energy_error"):
    """Multiply a curve by a factor, or by a function of the step size per stage."""

    def change(results):
        cube = results.cubes[system]
        by = factor(cube["tau_per_stage"]) if callable(factor) else factor
        for name in names:
            cube[variable].loc[{"integrator": name}] = cube[variable].sel(integrator=name) * by

    return change


def steeper(system, name):
    return scaled(system, lambda x: x**0.2, name)


def swapped(system, one, other, variable="max_energy_error"):
    def change(results):
        rows = results.cubes[system][variable]
        first, second = (rows.sel(integrator=name).values.copy() for name in (one, other))
        rows.loc[{"integrator": one}], rows.loc[{"integrator": other}] = second, first

    return change


def cell(table, row, column, text):
    def change(results):
        results.tables[table][row][column] = text

    return change


def put(cube, variable, value, **where):
    def change(results):
        results.cubes[cube][variable].loc[where] = value

    return change


def method(name, other):
    """Put another method in the place of ``name``: a name, or a function of the methods."""

    def change(results):
        found = results.methods[other] if isinstance(other, str) else other(results.methods)
        results.methods[name] = found

    return change


def nudged(tableau, by):
    """``tableau`` with the outermost coefficients larger by ``by`` and their neighbours smaller."""
    row = [Fraction(c) for c in tableau.outer]
    for i, sign in ((0, 1), (1, -1)):
        row[i] += sign * Fraction(by)
        row[-1 - i] = row[i]
    key = "kick" if tableau.first == "kick" else "drift"
    return replace(tableau, **{key: tuple(fixed_point_of(c) for c in row)})


def fixed_point_of(number):
    from mpmath import mp, mpf

    with mp.workdps(120):
        return fixed_point(mpf(number.numerator) / number.denominator, 90)


def thirds(_):
    """Three stages, the kick first, with coefficients of no use."""
    return Tableau(
        name="thirds", label="thirds", order=2, first="kick", source="none", digits=20,
        kick=palindrome("0.1", "0.4"), drift=palindrome("0.3", centre="0.4"),
    )  # fmt: skip


def even_drifts(_):
    return Tableau(
        name="even", label="even", order=2, first="kick", source="none", digits=20,
        kick=palindrome("0.125", "0.25", centre="0.25"), drift=("0.25",) * 4,
    )  # fmt: skip


def together(*changes):
    def change(results):
        for one in changes:
            one(results)

    return change


def document(function):
    return lambda results: function(results.document)


def panel(letter, variable, value):
    def change(results):
        results.figure_6[letter][variable] = value

    return change


def panels_swapped(results):
    results.figure_6["A"], results.figure_6["B"] = results.figure_6["B"], results.figure_6["A"]


def wrong_evaluations(results):
    results.cubes["kepler"]["evaluations"][0, 3] += 1


def equal_errors(results):
    for name in kepler.COINCIDING[1:]:
        swap = results.cubes["kepler"]["max_energy_error"]
        swap.loc[{"integrator": name}] = swap.sel(integrator=kepler.COINCIDING[0])


def advance_follows_maximum(results):
    cube = results.cubes["kepler"]
    cube["perihelion_advance"] = cube["max_energy_error"] * 3
    cube["perihelion_advance_interval"] = cube["max_energy_error"] * 0.001


def fewer_odd_terms(results):
    kappa = results.cubes["sho_terms"]["kappa"]
    kappa.loc[{"first": "drift", "integrator": "babs7o7h"}] = kappa.sel(first="drift", integrator="babs7o7h").where(
        kappa["order"] % 2 == 0, 0.0
    )


def another_start(module, momentum):
    """The system of a module starts with another momentum."""

    def change(results, monkeypatch):
        monkeypatch.setattr(module, "SYSTEM", replace(module.SYSTEM, p0=("0", momentum)))

    return change


def pure_fourth(results):
    cube = results.cubes["henon_heiles"]
    for name in ("babps8o7h", "babps9o7h"):
        x = cube["tau_per_stage"]
        cube["max_energy_error"].loc[{"integrator": name}] = np.maximum(0.011 * x**4, 1e-16)


TERM = "cubes/sho_terms"
#: id -> verdict on sound results, what is changed, verdict then.
TURNED = {
    "negative-coefficients": (HOLDS, method("x", lambda _: stand_in("x", ("1",), ("0.5", "0.5"))), FAILS),
    "sums-are-one": (HOLDS, method("x", lambda _: stand_in("x", ("0.9",), ("0.5", "0.5"))), PART),
    "even-orders": (HOLDS, cell("integrators", 0, "order", "5"), PART),
    "table-1": (HOLDS, cell("table1_structure", 0, "ABA d value", "0.1"), PART),
    "time-reversible": (HOLDS, cell("structure", 1, "return error", "1e-12"), PART),
    "symplectic": (HOLDS, cell("structure", 0, "symplectic defect", "2e-22"), PART),
    "first-same-as-last": (HOLDS, wrong_evaluations, PART),
    "c-n-below-eq-6": (FAILS, method("ruth", even_drifts), HOLDS),
    "eq-6-rounding": (HOLDS, method("babs7o7h", "ruth"), FAILS),
    "table-2": (HOLDS, cell("table2_recursion", 2, "tau^1", "Q[1,1]"), PART),
    "eq-13": (HOLDS, method("ruth", thirds), PART),
    "eq-14-only-solution": (HOLDS, method("ruth", thirds), FAILS),
    "eq-15": (HOLDS, method("ruth", lambda known: nudged(known["ruth"], "1e-60")), FAILS),
    "table-3": (HOLDS, cell("table3_even_orders", 2, "tau^2", "-0.0616"), PART),
    "table-3-inner-limit": (
        FAILS,
        together(
            cell("table3_even_orders", 2, "tau^4 of Table 2", "0.0"),
            cell("table3_even_orders", 3, "tau^4 of Table 2", "0.2729056869075995"),
        ),
        HOLDS,
    ),
    "eq-16": (HOLDS, cell("table3_even_orders", -1, "tau^4", "0.0417"), FAILS),
    "harmonic-four-is-four": (HOLDS, cell("integrators", 1, "order", "2"), FAILS),
    "growth-of-lambda-h": (HOLDS, cell("derived_orders", 2, "harmonic order reached", "6"), FAILS),
    "kappa-below-1e-128": (
        HOLDS, document(lambda known: known["printed"][0]["continued"].update(residual="1e-120")), PART,
    ),
    "simplex-reaches": (HOLDS, cell("derived_routes", 1, "largest kappa", "0.01"), PART),
    "picked-by-sum-and-next-term": (HOLDS, cell("derived_families", 0, "members better in all", "3"), PART),
    "above-seven-more-negative": (
        HOLDS, document(lambda known: known["isolated"][1]["roots"][1].update(outer=["-1"] * 4)), FAILS,
    ),
    "table-4-solves": (HOLDS, method("abas5o6h", lambda known: nudged(known["abas5o6h"], "1e-40")), PART),
    "table-4-fourth-order": (HOLDS, method("abas5o6h", lambda known: nudged(known["abas5o6h"], "1e-3")), PART),
    "table-4-stages": (HOLDS, method("babps9o7h", "babps8o7h"), FAILS),
    "table-4-names": (
        HOLDS, method("babps9o7h", lambda known: replace(known["babps8o7h"], label="BAB's9o7H")), PART,
    ),
    "table-4-77-digits": (HOLDS, method("abas5o6h", "ruth"), PART),
    "table-4-derived": (PART, cell("table4_derived", 1, "agreeing decimals", "76"), HOLDS),
    "table-4-c3": (FAILS, cell("table4_derived", 1, "agreeing decimals", "76"), HOLDS),
    "four-unique-sets": (HOLDS, document(lambda known: known["agreements"][3].update(decimals=40)), PART),
    "five-stage-solutions": (FAILS, cell("derived_counts", 0, "real solutions by Sturm", "3"), HOLDS),
    "unique-sets-solve-both": (PART, method("babs6o7h", "abas5o6h_b"), HOLDS),
    "bab-and-bab-prime": (
        PART,
        together(*(
            method(name, lambda known: known["abas5o6h"].role("kick")) for name in ("babs6o7h", "babs6o5h", "babs7o7h")
        )),
        FAILS,
    ),
    "near-forward": (HOLDS, method("ruth", "babs7o7h"), FAILS),
    "table-4-columns": (
        FAILS,
        together(*(cell("derived_errors", row, "max error, Henon-Heiles", "1e-9") for row in (3, 5))),
        HOLDS,
    ),
    "roles-switched": (HOLDS, cell("derived_errors", 3, "max error, Henon-Heiles", "9e-8"), PART),
    "listed-stages": (PART, method("babps8o7h", "babs7o7h"), HOLDS),
    "listed-stages-babps8o7h": (FAILS, method("babps8o7h", "babs7o7h"), HOLDS),
    "listed-compositions": (HOLDS, method("ruth", lambda known: known["ruth"].role("kick")), PART),
    "listed-orders": (HOLDS, method("aba104", lambda known: nudged(known["aba104"], "1e-3")), PART),
    "listed-generalised-orders": (HOLDS, cell("integrators", 2, "generalised order", "(8, 4)"), PART),
    "s5odr4-of-kahan-and-li": (FAILS, method("s5odr4", "mclachlan_ss5"), HOLDS),
    "yoshida-a-smallest": (HOLDS, method("yoshida_s7o6a", lambda _: methods.composed("B")), FAILS),
    "compensated-summation": (
        HOLDS, put("stability_rounding", "energy_error_rms", 9.0, source="plain", integrator="ruth"), PART,
    ),
    "floor-of-double": (HOLDS, put("sho", "max_energy_error", 2e-15, precision="double", integrator="ruth"), PART),
    "fig-1-sixth-order": (HOLDS, steeper("sho", "babps9o7h"), PART),
    "fig-1-fourth-order": (HOLDS, steeper("sho", "aba104"), PART),
    "fig-1-yoshida": (HOLDS, steeper("sho", "yoshida_s7o6a"), FAILS),
    "kappa-0-and-1": (HOLDS, put("sho_terms", "kappa", 1.0, order=1, integrator="aba864"), PART),
    "fig-2-even-orders-meet": (
        HOLDS, put("sho_terms", "kappa", 0.5, order=8, integrator="babps9o7h", first="drift"), PART,
    ),
    "fig-2-more-terms-as-aba": (HOLDS, fewer_odd_terms, PART),
    "fig-2-kappa-7": (HOLDS, put("sho_terms", "kappa", 1.0, order=7, integrator="babps8o7h", first="kick"), PART),
    "fig-2-reads-order": (PART, put("sho_terms", "kappa", 1.0, order=3), FAILS),
    "fig-2-yoshida-diverges": (
        HOLDS,
        together(*(put("sho_terms", "kappa", 1.0, integrator="yoshida_s7o6a", order=n) for n in range(7, 16))),
        FAILS,
    ),
    "fig-2-large-steps": (HOLDS, scaled("sho", 1e-3, "yoshida_s7o6a"), FAILS),
    "henon-heiles-energy": (HOLDS, another_start(henon_heiles.henon_heiles, "0.5"), FAILS),
    "fig-3-orders": (HOLDS, steeper("henon_heiles", "s5odr4"), PART),
    "fig-3-sixth-order-descent": (HOLDS, pure_fourth, FAILS),
    "kepler-starts-at-aphelion": (HOLDS, another_start(kepler.kepler, "0.130"), FAILS),
    "fig-5-orders": (HOLDS, steeper("kepler", "ruth"), PART),
    "fig-5-best-maximum": (HOLDS, swapped("kepler", "aba104", "ruth"), FAILS),
    "fig-5-best-mean": (HOLDS, swapped("kepler", "babps9o7h", "ruth", "mean_energy_error"), FAILS),
    "fig-4-coincide": (HOLDS, scaled("kepler", 1.5, "aba104", variable="perihelion_advance"), FAILS),
    "fig-4-intervals": (HOLDS, scaled("kepler", 200, "aba104", variable="perihelion_advance_interval"), FAILS),
    "figure-of-the-precession": (FAILS, equal_errors, HOLDS),
    "accumulated-error-and-mean": (HOLDS, advance_follows_maximum, FAILS),
    "fig-6-c-unstable": (HOLDS, panel("C", "left_at", 0), FAILS),
    "fig-6-others-stable": (HOLDS, panel("A", "left_at", 3), PART),
    "fig-6-large-substeps": (HOLDS, panels_swapped, PART),
    "outperform-ruth-sho": (HOLDS, scaled("sho", 1e-6, "ruth"), FAILS),
    "outperform-ruth-henon-heiles": (HOLDS, scaled("henon_heiles", 1e-4, "ruth"), FAILS),
    "outperform-ruth-kepler": (HOLDS, scaled("kepler", 0.1, "ruth"), FAILS),
    "outperform-optimised-sho": (HOLDS, scaled("sho", 1e4, "babs7o7h"), FAILS),
    "outperform-optimised-henon-heiles": (HOLDS, scaled("henon_heiles", 500, *NEW), FAILS),
    "outperform-optimised-kepler": (FAILS, scaled("kepler", 100, "aba104"), HOLDS),
    "yoshida-moderate-steps-sho": (HOLDS, scaled("sho", 1e-5, "yoshida_s7o6a"), FAILS),
    "yoshida-moderate-steps-henon-heiles": (HOLDS, scaled("henon_heiles", 1e-3, "yoshida_s7o6a"), FAILS),
    "yoshida-moderate-steps-kepler": (HOLDS, scaled("kepler", 1e-7, "yoshida_s7o6a"), FAILS),
    "best-performance": (PART, scaled("kepler", 100, "aba104"), HOLDS),
    "stable-with-large-steps": (HOLDS, put("linear_stability", "start", 3.0, integrator="babps9o7h"), PART),
    "t-not-quadratic": (
        HOLDS, put("kinetic_energy", "relative_error", 0.01, amplitude=1.0, integrator="abas5o6h"), PART,
    ),
    "high-order-negative": (HOLDS, cell("integrators", 5, "negative coefficients", "1"), FAILS),
}  # fmt: skip

BY_ID = {one.id: one for one in CLAIMS}


def test_the_list_below_names_every_statement():
    assert set(TURNED) == set(BY_ID)
    assert len(CLAIMS) == len(BY_ID)


@pytest.mark.parametrize("name", BY_ID)
def test_a_damaged_result_turns_the_verdict(name, monkeypatch):
    before, change, after = TURNED[name]
    assert before != after
    assert BY_ID[name].decision(sound_results()).verdict == before
    results = sound_results()
    if change.__code__.co_argcount == 2:
        change(results, monkeypatch)
    else:
        change(results)
    assert BY_ID[name].decision(results).verdict == after


@pytest.mark.parametrize("name", BY_ID)
def test_a_statement_reads_the_files_that_it_says_it_needs_and_no_other(name):
    results = sound_results()
    BY_ID[name].decision(results)
    assert results.read == set(BY_ID[name].needs)
