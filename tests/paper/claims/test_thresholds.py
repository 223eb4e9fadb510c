"""Thresholds of result files, for results just below and just above each threshold."""

from __future__ import annotations

import re

import numpy as np
import pytest

from nearharmonic.integrators import BENCHMARKED
from nearharmonic_paper.claims.table import CLAIMS
from support.results.changed_results import cell, put, together
from support.results.sound_results import sound_results
from support.results.stated_numbers import plain
from support.results.threshold_results import (
    NEW,
    above_floor,
    advance,
    chaotic,
    curve,
    even_term,
    first_loss,
    first_spike,
    halves,
    interval,
    largest_of_yoshida,
    long_substep,
    one_term_more,
    power,
    residual,
    roles,
    shares_of_the_best,
    times_the,
)

HOLDS, PART, FAILS, ERRATUM = "holds", "holds in part", "fails", "erratum"
DOT = 10**0.1
BLANES = ("aba104", "aba864", "aba1064")
OTHERS = {name: tuple(one for one in BENCHMARKED if one != name) for name in ("aba104", "babps9o7h", "yoshida_s7o6a")}
MAXIMUM = ("max_energy_error",)
#: id -> what puts its number at a share of the threshold, the verdict just below it, the verdict just above it.
TRIED = {
    **{
        f"outperform-ruth-{s.replace('_', '-')}": (
            times_the(np.max, 100, ("ruth",), NEW, (s,), MAXIMUM), FAILS, HOLDS,
        )
        for s in ("sho", "henon_heiles", "kepler")
    },
    **{
        f"outperform-{whose}-{s.replace('_', '-')}": (times_the(np.min, 1, NEW, theirs, (s,)), HOLDS, FAILS)
        for whose, theirs in (("kahan", ("s5odr4",)), ("blanes", BLANES))
        for s in ("sho", "henon_heiles", "kepler")
    },
    **{
        f"yoshida-moderate-steps-{s.replace('_', '-')}": (
            times_the(np.min, 1, NEW, ("yoshida_s7o6a",), (s,)), HOLDS, FAILS,
        )
        for s in ("sho", "henon_heiles", "kepler")
    },
    "outperform-ruth": (times_the(np.max, 1, ("ruth",), NEW), FAILS, HOLDS),
    "greatly-and-consistently": (times_the(np.max, 10, ("ruth",), NEW), FAILS, HOLDS),
    "significantly-better": (times_the(np.min, 1 / DOT, NEW, BENCHMARKED[:-4]), HOLDS, PART),
    "best-performance": (shares_of_the_best, FAILS, HOLDS),
    "stable-with-large-steps": (first_loss, FAILS, HOLDS),
    "stable-first-spike": (first_spike, FAILS, HOLDS),
    "fig-1-sixth-order": (together(*(power("sho", name, 6, 0.5) for name in NEW)), HOLDS, FAILS),
    "fig-1-fourth-order": (together(*(power("sho", n, 4, 0.5) for n in ("ruth", "s5odr4", *BLANES))), HOLDS, FAILS),
    "fig-1-yoshida": (power("sho", "yoshida_s7o6a", 6, 0.5), HOLDS, FAILS),
    "fig-3-orders": (power("henon_heiles", "ruth", 4, 0.5), HOLDS, PART),
    "fig-5-orders": (power("kepler", "ruth", 4, 0.5), HOLDS, PART),
    "fig-3-sixth-order-descent": (
        together(*(power("henon_heiles", name, 6, 0.5) for name in NEW[-2:])), HOLDS, FAILS,
    ),
    "fig-3-steepest": (
        together(
            *(power("henon_heiles", name, 4, 0.1) for name in ("abas5o6h", "babs7o7h")),
            *(power("henon_heiles", name, 6, 0.5) for name in NEW[-2:]),
        ),
        HOLDS, FAILS,
    ),
    "kappa-0-and-1": (put("sho_terms", "kappa", 1e-30, order=1, integrator="aba864"), HOLDS, PART),
    "fig-2-even-orders-meet": (even_term, HOLDS, PART),
    "fig-2-more-terms-as-aba": (one_term_more, PART, HOLDS),
    "fig-2-kappa-7": (put("sho_terms", "kappa", 1e-30, order=7, integrator="babps8o7h", first="kick"), HOLDS, PART),
    "fig-2-reads-order": (put("sho_terms", "kappa", 1e-30, order=3, integrator="babps8o7h"), HOLDS, PART),
    "fig-2-yoshida-diverges": (largest_of_yoshida, FAILS, HOLDS),
    "fig-2-large-steps": (
        times_the(np.min, 10, ("yoshida_s7o6a",), OTHERS["yoshida_s7o6a"], ("sho",), MAXIMUM), FAILS, HOLDS,
    ),
    "henon-heiles-chaotic": (chaotic, FAILS, HOLDS),
    "fig-5-best-maximum": (times_the(np.min, 1, ("aba104",), OTHERS["aba104"], ("kepler",), MAXIMUM), HOLDS, FAILS),
    "fig-5-best-mean": (
        times_the(np.min, 1, ("babps9o7h",), OTHERS["babps9o7h"], ("kepler",), ("mean_energy_error",)), HOLDS, FAILS,
    ),
    "fig-4-coincide": (advance(DOT), HOLDS, FAILS),
    "fig-4-intervals": (interval((DOT - 1) / DOT), HOLDS, FAILS),
    "precession-linear": (halves, HOLDS, FAILS),
    "figure-of-the-precession": (
        together(
            lambda results, by: times_the(np.min, 1, ("aba104",), ("abas5o6h",), ("kepler",))(results, 1),
            times_the(np.min, DOT, ("babps8o7h",), ("abas5o6h",), ("kepler",)),
        ),
        HOLDS, ERRATUM,
    ),
    "time-reversible": (cell("structure", 1, "return error", 1e-13), HOLDS, PART),
    "symplectic": (cell("structure", 0, "symplectic defect", 1e-22), HOLDS, PART),
    "kappa-below-1e-128": (residual, HOLDS, PART),
    "simplex-reaches": (
        together(*(cell("derived_routes", row, "largest kappa", 1e-128) for row in (1, 2))), HOLDS, FAILS,
    ),
    "more-stages-more-inappropriate": (long_substep, PART, HOLDS),
    "roles-switched": (roles(10, [(3, 2), (5, 4)]), FAILS, HOLDS),
    "performance-depends-on-scheme": (roles(DOT, [(1, 0)]), PART, HOLDS),
    "compensated-summation": (
        put("stability_rounding", "energy_error_rms", 10, source="plain", integrator="ruth"), PART, HOLDS,
    ),
    "floor-of-double": (above_floor, HOLDS, PART),
    "t-not-quadratic": (
        together(*(put("kinetic_energy", "max_energy_error", DOT, roles="own", integrator=name) for name in NEW)),
        FAILS, HOLDS,
    ),
    "close-encounters": (
        put("stability_kepler", "energy_error", 0.01, integrator="ruth", eccentricity=0.2), HOLDS, PART,
    ),
}  # fmt: skip
#: What is counted or ranked, in integers, or computed of methods: their thresholds are tried in other tests.
COUNTED = {
    "picked-among-thousands", "above-seven-more-negative", "high-order-negative", "minimised-coefficients",
    "accumulated-error-and-mean", "table-2",
}  # fmt: skip
BY_ID = {one.id: one for one in CLAIMS}


def test_every_threshold_of_result_files_is_tried():
    assert set(TRIED) | COUNTED == {one.id for one in CLAIMS if one.bound is not None and one.needs}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIED)
def test_the_verdict_turns_at_the_threshold(name):
    change, below, above = TRIED[name]
    found = []
    for by in (0.98, 1.02):
        results = sound_results()
        change(results, by)
        found.append(BY_ID[name].decision(results))
    assert [one.verdict for one in found] == [below, above]
    if "stable" not in name:  # whose step sizes are those of a grid, 6 % apart
        ends = re.search(r"same verdict(?: from (\S+))?(?: up)?(?: (?:up )?to (\S+))?$", plain(found[1].margin))
        bound = BY_ID[name].bound
        assert any(end and abs(float(end) / bound - 1) < 0.045 for end in ends.groups()), found[1].margin


def test_thousands_are_two_of_them():
    for members, verdict in (("1999", PART), ("2000", HOLDS)):
        results = sound_results()
        results.tables["derived_families"][0]["members found"] = members
        assert BY_ID["picked-among-thousands"].decision(results).verdict == verdict


def test_often_is_more_than_half():
    """The solutions have 4, 5 and 6 negative coefficients, BABs7o7H has 4."""
    for kept, verdict in ((2, FAILS), (3, HOLDS)):
        results = sound_results()
        del results.document["isolated"][1]["roots"][kept:]
        assert BY_ID["above-seven-more-negative"].decision(results).verdict == verdict


def test_what_the_changes_do_not_touch_stays(monkeypatch):
    results = sound_results()
    before = curve(results, "kepler", "ruth").copy()
    TRIED["fig-5-best-maximum"][0](results, 1.02)
    assert (curve(results, "kepler", "ruth") == before).all()
