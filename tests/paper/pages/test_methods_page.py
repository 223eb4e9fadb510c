"""docs/reference/methods.md: its table is that of the registry, and its statements on single methods are computed."""

from __future__ import annotations

import re

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.output.page import filled
from nearharmonic_paper.pages import methods
from support.results.stated_numbers import ROOT, flat, states

from .test_documented_numbers import decades, least_and_most

PAGE = "docs/reference/methods.md"
TEXT = (ROOT / PAGE).read_text(encoding="utf-8")
FLAT = flat(PAGE)
STEPS = [0.03, 0.05, 0.1, 0.2, 0.3]


@pytest.mark.slow
def test_tables_are_those_of_the_registry_and_of_runs():
    assert filled(TEXT, methods.parts()) == TEXT
    assert states(PAGE, methods.FACTORS.values(), "as long as a force", "Hénon-Heiles", "Kepler")


@pytest.mark.slow
def test_each_method_has_a_row_with_its_proved_orders():
    tables = TEXT.partition("<!-- errors -->")[0]
    rows = {name: cells.split(" | ") for name, cells in re.findall(r"^\| `(\w+)` \| (.*) \|$", tables, re.MULTILINE)}
    assert rows.keys() == {*nh.integrators}
    for name, one in nh.implicit_integrators.items():
        assert rows.pop(name) == [one.label, "implicit", str(one.stages), str(one.order), str(nh.harmonic_order(name))]
    for name, cells in rows.items():
        one = nh.integrators[name]
        last = one.gradients, nh.order_of(name)
        if not one.modified:
            last = nh.order_of(name), one.order if one.requires else nh.order_of(name)
        composition = {"drift": "ABA", "kick": "BAB"}[one.first]
        assert cells == [one.label, composition, str(one.stages), *map(str, last), str(nh.harmonic_order(name))]


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, one in plain_integrators.items() if one.requires is None])
def test_no_method_without_requirement_gains_order_for_quadratic_T(name):
    from nearharmonic.theory.order import nystrom_order_of

    assert nystrom_order_of(name) == nh.order_of(name)


def test_the_corrected_digit_is_where_the_page_says():
    place, index = re.findall(r"the (\d+)st decimal of `drift\[(\d)\]`", FLAT)[0]
    tableau = nh.integrators["teloy_8a17c"]
    digits = tableau.drift[int(index)].partition(".")[2]
    assert digits[int(place) - 1] == "3"
    copied = (ROOT / "tests/library/exchange/tableaus/libraries/teloy_8a17c.toml").read_text(encoding="utf-8")
    assert f'"0.{digits[: int(place) - 1]}6{digits[int(place) :]}"' in copied
    assert f'"0.{digits}"' not in copied


def test_methods_that_are_not_symmetric_are_those_that_page_names():
    (sentence,) = re.findall(r"- (`ruth_s3o3`.*?) are not symmetric", FLAT)
    assert sentence == "`ruth_s3o3` and `mclachlan_atela_2` to `mclachlan_atela_5`"
    named = {"ruth_s3o3", *(f"mclachlan_atela_{order}" for order in range(2, 6))}
    assert not any(nh.integrators[name].symmetric for name in named)
    assert all(nh.integrators[name].kick[-1] == "0" for name in named)


def test_6a8_is_as_good_as_babs8o6_7h():
    gain = decades("henon_heiles", "babs8o6_7h", STEPS) - decades("henon_heiles", "nystrom_6a8", STEPS)
    better, *worse = dict.fromkeys(abs(gain.round(1)).tolist())
    assert (gain.round(1) > 0).tolist() == [True] * 3 + [False] * 2
    assert states(PAGE, [better, *STEPS[:3], *worse, *STEPS[3:]], "Hénon-Heiles 6A8", "better", "worse")
    hours = np.geomspace(2, 30, 9)
    assert abs(decades("kepler", "babs8o6_7h", hours) - decades("kepler", "nystrom_6a8", hours)).max() < 0.1
    assert states(PAGE, [2, 30, 0.1], "Kepler", "differ")
    loss = decades("sho", "nystrom_6a8", STEPS) - decades("sho", "babs8o6_7h", STEPS)
    assert states(PAGE, [*least_and_most(loss), STEPS[0], STEPS[-1]], "oscillator", "`babs8o6_7h` is better")


@pytest.mark.slow
def test_what_page_says_of_modified_integrators_follows_from_their_errors():
    def errors(system, charged):
        factor = methods.FACTORS[system] if charged else 1
        modified = {name: methods.decades(system, one, factor) for name, one in nh.modified_integrators.items()}
        return modified, {name: methods.decades(system, nh.integrators[name], 1) for name in methods.PLAIN}

    modified, plain = errors("kepler", charged=False)
    best = np.min([*plain.values()], axis=0)
    assert (modified["abag5o6"] < best - 0.5).all()
    modified, plain = errors("kepler", charged=True)
    assert abs(modified["abag5o6"] - plain["srkn_a14"])[:2].max() < 0.1
    assert modified["rowlands"][2] < np.min([*plain.values()], axis=0)[2] - 0.5
    modified, plain = errors("henon_heiles", charged=False)
    assert modified["rowlands"][2] < np.min([*plain.values()], axis=0)[2] - 0.5
    modified, plain = errors("henon_heiles", charged=True)
    assert (np.min([*modified.values()], axis=0) > np.min([*plain.values()], axis=0)).all()


def test_leading_errors_of_family_members_match_page():
    from nearharmonic.theory.order import leading_errors

    norms = [float(f"{leading_errors(name).nystrom.norm:.2e}") for name in ("abag5o6", "omelyan_g5o6")]
    assert states(PAGE, norms, "for the published member")


@pytest.mark.parametrize(
    "page", ["docs/results/sixth_order.md", "CHANGELOG.md", "src/nearharmonic/integrators/nearharmonic_2026.py"]
)
def test_who_praises_our_method_of_order_six_names_published_one(page):
    assert "6A8" in (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "work", ["McLachlan & Gray (1997)", "Blanes, Casas & Murua (2008)", "Blanes, Casas & Sanz-Serna (2014)",
             "Blanes, Casas & Murua (2015)", "Blanes, Casas & Murua (2024)"],
)  # fmt: skip
def test_prior_art_is_named(work):
    assert work in FLAT
