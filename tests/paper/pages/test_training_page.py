"""docs/results/training.md: its statements on registered methods are proved."""

from __future__ import annotations

from fractions import Fraction

import pytest

import nearharmonic as nh
from nearharmonic.output.page import filled
from nearharmonic.training.objective import DIGITS, LARGEST_SUM, NEAREST, WEIGHT_OF_MEAN
from nearharmonic.training.search import SAMPLES, Effort
from nearharmonic_paper.pages.training import parts
from nearharmonic_studies.trained.problems.purpose import ECCENTRICITIES, MODERATE, SMALL, STRONG, WEAK
from nearharmonic_studies.trained.problems.purposes import PURPOSES
from nearharmonic_studies.trained.problems.random_potentials import FREQUENCIES
from nearharmonic_studies.trained.search import LONGER, SHORT_LIST
from nearharmonic_studies.trained.settings import SearchSettings
from support.results.stated_numbers import ROOT, states

PLACE = "docs/results/training.md"
PAGE = (ROOT / PLACE).read_text(encoding="utf-8")
SETTINGS, EFFORT = SearchSettings(), Effort(trials=1)


@pytest.mark.slow
def test_tables_of_page_are_those_of_registered_methods():
    found = parts({})
    del found["landscape"]  # of searches
    assert all(text.count("\n|") > 2 for text in found.values())
    assert filled(PAGE, found) == PAGE


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (FREQUENCIES, ("frequency 1 and the others",)),
        (STRONG, ("log-uniform",)),
        (WEAK, ("`trained_weak`", "log-uniform")),
        ([*SMALL, *MODERATE], ("coordinates whose strength is",)),
        ([SAMPLES], ("The derivatives of", "along the surface")),
        (ECCENTRICITIES, ("Kepler orbits of eccentricity",)),
        ([SETTINGS.systems, SETTINGS.held_out, SETTINGS.held_out], ("problems for training", "for the gains")),
        ([round(min(one.window[1] / one.window[0] for one in PURPOSES.values()), 1)], ("width of a window",)),
        ([EFFORT.population], ("methods of a generation",)),
        ([DIGITS], ("onto the exact equations", "digits")),
        ([NEAREST], ("onto the exact equations", "by less than")),
        ([EFFORT.same_value, EFFORT.same_unknowns], ("number of searches", "within")),
        ([LARGEST_SUM], ("keeps this sum below",)),
    ],
)
def test_settings_of_the_search_are_those_of_the_page(wanted, words):
    assert states(PLACE, wanted, *words)


def test_words_of_the_page_are_settings_of_the_search():
    assert (SHORT_LIST, LONGER) == (3, 2)
    assert "the best three methods of each family over intervals twice as long" in " ".join(PAGE.split())
    assert {len(one.tau_per_stage) for one in PURPOSES.values()} == {3}
    assert "each of three step sizes of a window" in " ".join(PAGE.split())
    assert WEIGHT_OF_MEAN == 0.5
    unknowns = max(family.unknowns for one in PURPOSES.values() for chain in one.chains for family in chain.families())
    assert states(PLACE, [unknowns], "have up to", "unknowns")


def test_the_middle_kick_of_chins_method_is_as_stated():
    chin = nh.integrators["chin_4a"]
    _, kick, _ = map(Fraction, chin.kick)
    _, square, _ = map(Fraction, chin.square)
    found = (one.limit_denominator(100) for one in (square, kick))
    assert "m = {} for a net kick of {}.".format(*found) in PAGE
