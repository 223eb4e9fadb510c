"""Nine committed verdicts against those of a second program, which takes nothing but coefficients from the package."""

from __future__ import annotations

import json
import re

import pytest

from support.results.stated_numbers import ROOT
from support.second_opinion import exact_statements, numeric_statements

COMMITTED = {entry["id"]: entry for entry in json.loads((ROOT / "docs/claims.json").read_text(encoding="utf-8"))}
#: Verdict of each, and whether the second program finds numbers that the committed value states as well.
EXPECTED = {
    "eq-14-only-solution": ("holds", True),
    "table-3-inner-limit": ("erratum", True),
    "bab-prime-leaves-q": ("fails", True),
    "fig-2-even-orders-meet": ("holds", True),
    "fig-2-kappa-7": ("holds", True),
    "fig-3-sixth-order-descent": ("holds in part", False),
    "fig-4-coincide": ("holds but for edges", True),
    "outperform-ruth": ("holds", False),
    "outperform-ruth-kepler": ("fails", True),
}


@pytest.mark.parametrize(
    ("statement", "opinion"),
    [
        *exact_statements.STATEMENTS.items(),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in numeric_statements.STATEMENTS.items()),
    ],
)
def test_second_program_reaches_the_committed_verdict_and_its_numbers(statement, opinion):
    verdict, phrases = opinion()
    assert (verdict, bool(phrases)) == EXPECTED[statement]
    assert COMMITTED[statement]["verdict"] == verdict
    assert [phrase for phrase in phrases if phrase not in COMMITTED[statement]["value"]] == []


def test_second_program_takes_coefficients_alone_from_the_package():
    texts = [file.read_text(encoding="utf-8") for file in (ROOT / "tests/support/second_opinion").glob("*.py")]
    assert re.findall(r"^(?:from|import) nearharmonic.*", "\n".join(texts), re.MULTILINE) == [
        "from nearharmonic.integrators import integrators"
    ]
