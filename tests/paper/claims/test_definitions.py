"""General words of the paper's sentences and the definitions that thresholds cite."""

from __future__ import annotations

import re

import pytest

from nearharmonic_paper.claims.judging import definitions
from nearharmonic_paper.claims.pages.documents import page
from nearharmonic_paper.claims.table import CLAIMS

#: Words in a sentence, and the definition of them.
WORDS = {
    "approximately": definitions.APPROXIMATELY,
    "significantly": definitions.SIGNIFICANTLY,
    "generally|usually|often": definitions.GENERALLY,
    "greatly|drastically|rapidly": definitions.GREATLY,
    "several orders of magnitude": definitions.SEVERAL_ORDERS,
    "several (?!orders)": definitions.SEVERAL,
    "not suitable": definitions.NOT_SUITABLE,
    "large": definitions.LARGE,
    "moderate": definitions.MODERATE,
    "small": definitions.SMALL,
    "stable|unstable": definitions.STABLE,
    "outperform|outperforms": definitions.PERFORMANCE,
}
#: Statements in which such a word compares with something that the threshold names: substeps of BABs7o7H, coefficients
#: of the other row, steps of Ruth's method, the oscillator's potential; a large coefficient is one that is not small.
RELATIVE = {
    ("fig-6-large-substeps", "large"), ("high-order-negative", "large"), ("small-coefficients-of-one-row", "small"),
    ("henon-heiles-near-harmonic", "small"), ("stable-with-large-steps", "large"), ("stable-linear-limit", "large"),
    ("stable-growth", "large"), ("stable-first-spike", "large"),
}  # fmt: skip


def test_a_statement_with_a_general_word_cites_its_definition():
    missing = {
        (one.id, words)
        for one in CLAIMS
        for words, meaning in WORDS.items()
        if re.search(rf"\b({words})(?!\w)", one.sentence, re.IGNORECASE) and meaning.brief not in one.threshold
    }
    assert missing == RELATIVE


@pytest.mark.parametrize("meaning", definitions.MEANINGS, ids=lambda one: one.words[:20])
def test_the_page_has_each_definition(meaning):
    text = re.sub(r"\s+", " ", page([_entry(one) for one in CLAIMS]))
    assert f"- {meaning.words}." in text


def _entry(one):
    paper = {"section": one.paper, "sentence": one.sentence}
    told = {"id": one.id, "paper": paper, "statement": one.statement, "kind": one.kind, "threshold": one.threshold}
    return {**told, "verdict": "not decided here", "value": "x", "margin": "", "needs": []}
