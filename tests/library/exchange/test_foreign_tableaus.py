"""Coefficients from other sources: proofs of published claims, and descriptions of errors.

The orders of the published files are those of their papers. The states that show the order of a library's method are
computed in multiprecision, with steps that share no code with the proofs.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import pytest
from mpmath import log, mpf

import nearharmonic as nh
from support.methods.tableau_files import failing, names, verdict
from support.oracles.multiprecision import energy_errors, trajectory

#: General order, order for quadratic T, and order on the oscillator.
PUBLISHED = {
    "bcss_s3": (2, 2, 2),
    "mclachlan_atela_4": (3, 4, 4),
    "morales_s17o8": (8, 8, 8),
    "na7": (4, 6, 6),
    "nystrom_6a8": (4, 6, 6),
    "omelyan_s7o6": (4, 6, 6),
    "predescu_s3": (2, 2, 2),
    "s17odr8a": (8, 8, 8),
    "sofspa_s11o6": (6, 6, 6),
    "sofspa_s19o8": (8, 8, 8),
    "srkn_a17": (4, 8, 8),
    "srkn_b18": (4, 8, 8),
    "teloy_6a9": (6, 6, 6),
    "teloy_8a17b": (4, 8, 8),
}
#: Claimed order or None, and proved: general, for quadratic T, on the oscillator.
LIBRARIES = {
    "blackjax_mclachlan": (None, 2, 2, 2),
    "blackjax_omelyan": (None, 4, 4, 4),
    "blackjax_yoshida": (None, 2, 2, 2),
    "desolver_abas5o6h": (6, 4, 4, 6),
    "desolver_babs9o7h": (7, 4, 4, 6),
    "diffrax_semi_implicit_euler": (1, 1, 1, 1),
    "galpy_symplec4": (4, 4, 4, 4),
    "galpy_symplec6": (6, 6, 6, 6),
    "geometricintegrators_mclachlan4": (4, 2, 2, 2),
    "geometricintegrators_mclachlan4_since": (4, 4, 4, 4),
    "mici_bcss_s2": (2, 2, 2, 2),
    "mici_bcss_s3": (2, 2, 2, 2),
    "mici_bcss_s4": (2, 2, 2, 2),
    "ordinarydiffeq_calvosanz4": (4, 3, 3, 4),
    "ordinarydiffeq_mcate4": (4, 3, 3, 4),
    "ordinarydiffeq_mcate42": (4, 1, 1, 1),
    "ordinarydiffeq_mcate5": (5, 3, 3, 5),
    "suzuki_yoshida_3": (4, 2, 2, 2),
    "suzuki_yoshida_5": (4, 2, 2, 2),
    "suzuki_yoshida_7": (6, 6, 6, 6),
    "xtrack_yoshida4": (4, 6, 6, 6),
    "xtrack_yoshida_4": (4, 4, 4, 4),
    "xtrack_yoshida_6": (6, 6, 6, 6),
    "xtrack_yoshida_8": (8, 8, 8, 8),
}


def orders(found):
    return found.order.order, found.quadratic_order.order, found.oscillator.order


#: The systems in which the methods show their orders, and starts on which no error term vanishes by chance.
HENON_HEILES = nh.systems["henon_heiles"], ([mpf("0.3"), mpf("0.1")], [mpf("0.2"), mpf("0.4")])
OSCILLATOR = nh.systems["sho"], ([mpf("0.3")], [mpf("0.4")])


def observed_order(file, system, start):
    """From three step sizes; its own next order leaves 0.05 at these."""
    ends = ([*chain(*trajectory(file, system, mpf(2) / n, n, start)[-1])] for n in (64, 128, 256))
    errors = [max(abs(x - y) for x, y in zip(a, b, strict=True)) for a, b in pairwise(ends)]
    return float(log(errors[0] / errors[1], 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_what_a_paper_says_of_its_method_is_proved(name):
    found = verdict("published", name)
    assert found.holds
    assert orders(found) == PUBLISHED[name]
    assert found.file.order == found.quadratic_order.order
    assert found.file.requires is not None or found.file.order == found.order.order


@pytest.mark.slow
@pytest.mark.parametrize("name", LIBRARIES)
def test_order_that_library_states_is_refuted_if_it_is_wrong(name):
    found = verdict("libraries", name)
    claimed, *proved = LIBRARIES[name]
    assert found.file.order == claimed
    assert orders(found) == tuple(proved)
    assert ("order" in failing(found)) == (claimed is not None and claimed > proved[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LIBRARIES if name.startswith("ordinarydiffeq")])
def test_what_is_proved_of_library_is_what_its_steps_show(name):
    found = verdict("libraries", name)
    assert observed_order(found.file, *HENON_HEILES) == pytest.approx(found.quadratic_order.order, abs=0.1)
    assert observed_order(found.file, *OSCILLATOR) == pytest.approx(found.oscillator.order, abs=0.1)


@pytest.mark.parametrize(("name", "order"), [("ordinarydiffeq_mcate4", 4), ("ordinarydiffeq_mcate5", 5)])
def test_exchanged_nystrom_method_is_reported_in_wrong_role(name, order):
    found = verdict("libraries", name)
    assert failing(found) == ["order", "first"]
    (role,) = [claim for claim in found.claims if claim.says == "first = drift"]
    both = f"order 3 for quadratic T with the drift first, order {order} for quadratic T with the kick first"
    assert role.proof == both
    (suspect,) = found.suspects
    assert (suspect.rows.kick, suspect.rows.drift, suspect.rows.first) == (found.file.drift, found.file.kick, "kick")


def test_nearest_method_decides_role_without_dependent_claim():
    found = verdict("libraries", "desolver_abas5o6h")
    assert failing(found) == ["order"]
    assert found.nearest.tableau.name == "abas5o6h"
    assert found.nearest.is_same
    assert found.nearest.exchanged
    assert found.warnings == [
        "the kick is first here, and the drift is in ABAs5o6H (abas5o6h), to which the coefficients belong"
    ]
    own = verdict("libraries", "desolver_babs9o7h")
    assert own.nearest.tableau.name == "babps9o7h"
    assert own.nearest.is_same
    assert not own.nearest.exchanged
    assert own.warnings == []


@pytest.mark.slow
def test_verify_finds_wrong_digit_at_twenty_first_decimal():
    found = verdict("libraries", "teloy_8a17c")
    assert failing(found) == ["rows", "order"]
    assert found.digits_that_hold == 22
    (suspect,) = found.suspects
    start = "drift[5] and its mirror image drift[11] = 0.26500275499062083398"
    assert suspect.says.startswith(start)
    mended = replace(found.file, kick=suspect.rows.kick, drift=suspect.rows.drift)
    assert observed_order(mended, *HENON_HEILES) == pytest.approx(8, abs=0.1)


@pytest.mark.parametrize(
    ("name", "claims", "says"),
    [
        ("digit", ["rows", "order"], "drift[1] and its mirror image drift[5] = 0.60470788"),
        (
            "sign",
            ["rows", "order"],
            "kick[2] and its mirror image kick[4] = 0.19724296189768175230925663095622519644388",
        ),
        ("lines", ["order"], "lines 1 and 2 of kick and drift: exchanged, every claim holds"),
        ("role", ["order", "first"], "the roles: with the drifts as kicks and the kicks as drifts, the kick first"),
    ],
)
def test_a_damage_is_named_for_what_it_is(name, claims, says):
    found = verdict("damaged", name)
    assert failing(found) == claims
    assert [one.says[: len(says)] for one in found.suspects] == [says]


def test_of_a_wrong_claim_no_coefficient_is_suspected():
    found = verdict("damaged", "claim")
    assert failing(found) == ["order"]
    assert found.order.order == 6
    assert found.suspects == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name", "position", "energy"),
    [
        ("published", "predescu_s3", 2, 6),
        ("published", "mclachlan_atela_4", 4, 4),
        ("libraries", "ordinarydiffeq_mcate5", 5, 5),
        ("libraries", "desolver_babs9o7h", 7, 6),
        ("libraries", "geometricintegrators_mclachlan4", 2, 2),
    ],
)
def test_energy_order_on_oscillator_is_that_of_many_steps(kind, name, position, energy):
    """BAB's9o7H is of order 7 in the position (Nielsen 2015, Table 4)."""
    found = verdict(kind, name)
    assert (found.oscillator.harmonic_order, found.oscillator.energy_order) == (position, energy)
    system, start = OSCILLATOR
    coarse, fine = (max(energy_errors(found.file, system, mpf(1) / n, 40 * n, start)) for n in (8, 16))
    assert float(log(coarse / fine, 2)) == pytest.approx(energy, abs=0.1)


# --- the page ---------------------------------------------------------------------------------------------------------


def tables():
    """Sets of rows of the two tables: orders that are wrong, and orders that hold."""
    place = Path(__file__).parents[3] / "docs/how_to/exchange.md"
    findings = place.read_text(encoding="utf-8").partition("### Findings")[2]
    return [{*table.splitlines()[2:]} for table in re.findall(r"(?:^\|.*\n)+", findings, re.MULTILINE)]


def test_table_holds_every_file_of_library_whose_order_is_wrong():
    rows = set()
    for name in names("libraries"):
        found = verdict("libraries", name)
        if not found.holds and all(orders(found)):  # a row whose sum is wrong has no order
            claimed = f"{found.file.order}{', quadratic T' if found.file.requires else ''}"
            rows.add(f"| {found.file.label} | {claimed} | {' | '.join(map(str, orders(found)))} |")
    assert len(rows) == 9
    assert tables()[0] == rows


@pytest.mark.slow
def test_table_holds_every_library_method_that_keeps_its_word():
    rows = set()
    for name in names("libraries"):
        found = verdict("libraries", name)
        if found.holds:
            cells = [found.file.label, found.file.order or "none", *orders(found), found.digits.number or "exact"]
            like = found.nearest
            exchanged = ", exchanged" if like and like.exchanged else ""
            ours = f" `{like.tableau.name}`{exchanged}" if like and like.is_same else ""
            rows.add(f"| {' | '.join(map(str, cells))} |{ours} |")
    assert len(rows) == 15
    assert tables()[1] == rows
