"""Every verdict can be turned: a statement, its verdict on sound results, a change of these, its verdict then."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nearharmonic.integrators import integrators
from nearharmonic_paper.claims.statements.equations import identities, misprints
from nearharmonic_paper.claims.statements.figures import henon_heiles, kepler
from nearharmonic_paper.claims.statements.tableaus import methods, splitting
from nearharmonic_paper.claims.statements.tableaus.coefficients import FIVE_STAGES, UNIQUE
from nearharmonic_paper.claims.table import CLAIMS
from support.results.changed_results import (
    advance_follows_maximum,
    another_potential,
    another_start,
    both,
    cell,
    document,
    draws,
    kicks_of,
    method,
    momentum_first,
    nudged,
    panel,
    panels_swapped,
    patched,
    put,
    quiet_substeps,
    reversed_order,
    scaled,
    steeper,
    terms_of_another_step,
    thirds,
    together,
)  # fmt: skip
from support.results.sound_results import sound_results, stand_in

from .test_thresholds import TRIED

HOLDS, EDGES, PART, FAILS, ERRATUM = "holds", "holds but for edges", "holds in part", "fails", "erratum"

#: Statements without a threshold in result files: id -> verdict on sound results, what is changed, verdict then.
TURNED = {
    "every-even-order": (HOLDS, patched(splitting, "tripled", lambda _: integrators["ruth"]), PART),
    "positive-force-gradient": (
        HOLDS, patched(splitting, "FORCE_GRADIENT", (integrators["ruth"], *splitting.FORCE_GRADIENT)), PART,
    ),
    "cost-proportional-to-stages": (
        HOLDS, method("ruth", lambda _: stand_in("ruth", ("0.5",) * 20, ("0.5",) * 20, stages=1)), FAILS,
    ),
    "eq-6-p-row": (HOLDS, patched(identities, "last_row", lambda m, q, drift, kick: m * q[1] / drift), FAILS),
    "initial-values-below-eq-17": (HOLDS, patched(identities, "CONSTANTS", (1, 1, 1, 1)), FAILS),
    "eq-2-product": (ERRATUM, patched(misprints, "FIRST_FACTOR", 1), HOLDS),
    "eq-2-order-symbol": (ERRATUM, method("ruth", "babps9o7h"), HOLDS),
    "q-bar-below-eq-11": (ERRATUM, patched(misprints, "MASS", 1), HOLDS),
    "eq-13-h1": (ERRATUM, patched(misprints, "drawn", lambda _: [identities.Drawn([1], [0])]), HOLDS),
    "eq-14-needs-sums": (ERRATUM, patched(misprints, "closed_form", lambda: (2, -3, 0.25, 0.25)), HOLDS),
    "four-unique-or-more": (ERRATUM, cell("derived_counts", 1, "real solutions by Sturm", "1"), HOLDS),
    "bab-prime-from-zero": (
        ERRATUM, method("babps9o7h", lambda _: stand_in("babps9o7h", ("1",), ("0.5", "0.5", "0"))), HOLDS,
    ),
    "henon-heiles-near-harmonic": (HOLDS, another_potential(henon_heiles.henon_heiles), FAILS),
    "outperform-ruth": (HOLDS, both("kepler", 1e-3, "ruth"), PART),
    "stable-linear-limit": (PART, method("ruth", "yoshida_s7o6a"), HOLDS),
    "stable-growth": (HOLDS, method("ruth", "babs7o7h"), FAILS),
    "negative-coefficients": (HOLDS, method("x", lambda _: stand_in("x", ("1",), ("0.5", "0.5"))), FAILS),
    "sums-are-one": (HOLDS, method("x", lambda _: stand_in("x", ("0.9",), ("0.5", "0.5"))), PART),
    "even-orders": (HOLDS, cell("integrators", 0, "order", "5"), PART),
    "table-1": (HOLDS, cell("table1_structure", 0, "ABA d value", "0.1"), PART),
    "first-same-as-last": (HOLDS, method("x", lambda _: stand_in("x", ("0.5", "0", "0.5"), ("0.5", "0.5"))), PART),
    "c-n-below-eq-6": (ERRATUM, draws([1, 2, 3], [5, 5, 5]), HOLDS),
    "eq-6-rounding": (HOLDS, method("babs7o7h", "ruth"), FAILS),
    "table-2": (HOLDS, cell("table2_recursion", 2, "tau^1", "Q[1,1]"), PART),
    "eq-13": (HOLDS, terms_of_another_step, PART),
    "eq-14-only-solution": (HOLDS, method("ruth", thirds), FAILS),
    "eq-15": (HOLDS, patched(identities, "closed_form", lambda: (2, -3, 0.25, 0.25)), PART),
    "table-3": (HOLDS, terms_of_another_step, PART),
    "table-3-inner-limit": (ERRATUM, draws([1, 2, 3, 4, 5], [5, 0, 0, 0, 0]), HOLDS),
    "eq-16": (HOLDS, terms_of_another_step, FAILS),
    "eq-16-general": (FAILS, patched(identities, "counterexample", lambda: integrators["ruth"].role("kick")), HOLDS),
    "harmonic-four-is-four": (HOLDS, cell("integrators", 1, "order", "2"), FAILS),
    "growth-of-lambda-h": (HOLDS, cell("derived_orders", 2, "harmonic order reached", "6"), FAILS),
    "picked-by-sum-and-next-term": (HOLDS, cell("derived_families", 0, "members better in all", "3"), PART),
    "picked-among-thousands": (HOLDS, cell("derived_families", 1, "members found", "300"), PART),
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
    "table-4-derived": (HOLDS, cell("table4_derived", 0, "agreeing decimals", "75"), FAILS),
    "table-4-c3": (ERRATUM, cell("table4_derived", 1, "agreeing decimals", "76"), HOLDS),
    "four-unique-sets": (HOLDS, document(lambda known: known["agreements"][3].update(decimals=40)), PART),
    "five-stage-solutions": (HOLDS, cell("derived_counts", 0, "real solutions by Sturm", "3"), FAILS),
    "six-stage-solutions": (HOLDS, cell("derived_counts", 1, "real solutions by Sturm", "1"), FAILS),
    "unique-sets-solve-both": (PART, method("babs6o7h", "abas5o6h_b"), HOLDS),
    "bab-leaves-p": (HOLDS, method("babs7o7h", lambda known: known["abas5o6h"].role("kick")), PART),
    "bab-prime-leaves-q": (FAILS, method("babps8o7h", momentum_first), PART),
    "near-forward": (
        HOLDS, together(*(method(name, "yoshida_s7o6a") for name in (*UNIQUE, "babs7o7h"))), FAILS,
    ),
    "small-near-forward-steps": (HOLDS, method("babs7o7h", "yoshida_s7o6a"), PART),
    "small-coefficients-of-one-row": (
        HOLDS,
        together(*(method(name, "babs7o7h") for name in ("abas5o6h", "abas5o6h_b", "babs6o5h", "babps6o5h"))),
        FAILS,
    ),
    "minimised-coefficients": (HOLDS, reversed_order(0.05), PART),
    "table-4-columns": (
        ERRATUM, together(*(method(name, kicks_of(name)) for name in FIVE_STAGES)), HOLDS,
    ),
    "roles-switched": (HOLDS, cell("derived_errors", 3, "max error, Henon-Heiles", "9e-8"), PART),
    "listed-stages": (HOLDS, method("aba864", "babps8o7h"), PART),
    "listed-stages-babps8o7h": (ERRATUM, method("babps8o7h", "babs7o7h"), HOLDS),
    "listed-orders": (HOLDS, method("aba104", lambda known: nudged(known["aba104"], "1e-3")), PART),
    "listed-generalised-orders": (HOLDS, cell("integrators", 2, "generalised order", "(8, 4)"), PART),
    "s5odr4-of-kahan": (
        FAILS, patched(methods, "S5ODR4", ("0.41449077179437573715", "-0.65796308717750294860")), HOLDS,
    ),
    "yoshida-a-smallest": (HOLDS, method("yoshida_s7o6a", lambda _: methods.composed("B")), FAILS),
    "fig-1-sixth-order": (HOLDS, steeper("sho", "babps9o7h"), PART),
    "fig-1-fourth-order": (HOLDS, steeper("sho", "aba104"), PART),
    "fig-2-reads-order": (HOLDS, put("sho_terms", "kappa", 1.0, order=3), FAILS),
    "henon-heiles-energy": (HOLDS, another_start(henon_heiles.henon_heiles, "0.5"), FAILS),
    "kepler-starts-at-aphelion": (HOLDS, another_start(kepler.kepler, "0.130"), FAILS),
    "eq-19-approximation": (HOLDS, patched(kepler, "MERCURY", 1.9e27), FAILS),
    "eq-20": (HOLDS, patched(kepler, "sin", kepler.cos), FAILS),
    "accumulated-error-and-mean": (HOLDS, advance_follows_maximum, FAILS),
    "fig-6-c-unstable": (HOLDS, panel("C", "left_at", 0), FAILS),
    "fig-6-others-stable": (
        HOLDS, put("substeps_displaced", "left_at", 7000, displacement=0.0, summation="plain"), PART,
    ),
    "fig-6-beside-the-plane": (
        FAILS, put("substeps_displaced", "left_at", 7000, displacement=1e-6, summation="plain"), PART,
    ),
    "fig-6-large-substeps": (HOLDS, panels_swapped, PART),
    "substeps-are-no-evolution": (HOLDS, quiet_substeps, PART),
    "outperform-kahan-sho": (HOLDS, scaled("sho", 1e4, "babs7o7h"), PART),
    "outperform-blanes-sho": (EDGES, both("sho", 1e-6, "aba864"), FAILS),
    "outperform-blanes-kepler": (PART, both("kepler", 100, "aba104"), HOLDS),
    "best-performance": (PART, both("kepler", 100, "aba104"), HOLDS),
    "greatly-and-consistently": (HOLDS, both("kepler", 1e-2, "ruth"), PART),
    "stable-with-large-steps": (HOLDS, scaled("kepler", 1e5, "babps9o7h"), PART),
    "high-order-negative": (HOLDS, method("yoshida_s7o6a", "babps9o7h"), PART),
}  # fmt: skip

BY_ID = {one.id: one for one in CLAIMS}


def test_every_statement_is_turned_here_or_at_its_threshold():
    assert {*TURNED, *TRIED} == set(BY_ID)
    assert len(CLAIMS) == len(BY_ID)


@pytest.mark.parametrize("name", TURNED)
def test_a_damaged_result_turns_the_verdict(name, monkeypatch):
    before, change, after = TURNED[name]
    assert before != after
    assert BY_ID[name].decision(sound_results()).verdict == before
    results = sound_results()
    results.patch = monkeypatch.setattr
    change(results)
    assert BY_ID[name].decision(results).verdict == after


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_ID)
def test_statement_reads_only_files_that_it_declares(name):
    results = sound_results()
    BY_ID[name].decision(results)
    assert results.read == {*BY_ID[name].needs, *BY_ID[name].also}


@pytest.mark.parametrize("name", [one.id for one in CLAIMS if one.also])
def test_information_on_other_targets_does_not_change_verdict(name):
    one, results = BY_ID[name], sound_results()
    full = one.decision(results)
    for file in one.also:
        del results.cubes[file.removeprefix("cubes/").removesuffix(".h5")]
    bare = one.decision(results)
    assert bare.verdict == full.verdict
    assert full.value.startswith(f"{bare.value}; ")


def test_runs_beside_the_plane_decide_nothing_of_panel_d():
    results = sound_results()
    results.cubes["substeps_displaced"]["left_at"][1:] = 7000
    verdicts = {
        name: BY_ID[name].decision(results).verdict for name in ("fig-6-others-stable", "fig-6-beside-the-plane")
    }
    assert verdicts == {"fig-6-others-stable": HOLDS, "fig-6-beside-the-plane": HOLDS}


def test_one_negative_coefficient_is_not_several():
    results = sound_results()
    cell("integrators", 5, "negative coefficients", "1")(results)
    assert BY_ID["high-order-negative"].decision(results).verdict == PART
    method("yoshida_s7o6a", "babps9o7h")(results)
    assert BY_ID["high-order-negative"].decision(results).verdict == FAILS
