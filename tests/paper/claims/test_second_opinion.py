"""Twelve committed verdicts against those of a second program, which shares no code with the package."""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path

import pytest

from support.second_opinion import exact_statements, numeric_statements

ROOT = Path(__file__).parents[3]
COMMITTED = {entry["id"]: entry for entry in json.loads((ROOT / "docs/claims.json").read_text(encoding="utf-8"))}
EXPECTED = {
    "eq-14-only-solution": "holds",
    "table-3-inner-limit": "erratum",
    "eq-16-general": "fails",
    "bab-prime-leaves-q": "fails",
    "fig-1-sixth-order": "holds",
    "fig-2-even-orders-meet": "holds",
    "fig-2-kappa-7": "holds",
    "fig-3-sixth-order-descent": "holds in part",
    "fig-4-coincide": "holds but for edges",
    "fig-6-c-unstable": "holds",
    "outperform-ruth": "holds",
    "outperform-ruth-kepler": "fails",
}
NUMBERS = EXPECTED.keys() - {"eq-16-general", "fig-1-sixth-order", "fig-3-sixth-order-descent", "outperform-ruth"}
#: Statements whose programs integrate all step sizes, for a minute.
LONGER = ("outperform-ruth", "fig-3", "fig-4")
PROGRAM = [
    *exact_statements.STATEMENTS.items(),
    *(
        pytest.param(*one, marks=pytest.mark.long if one[0].startswith(LONGER) else pytest.mark.slow)
        for one in numeric_statements.STATEMENTS.items()
    ),
]


def test_second_program_has_an_opinion_on_each_expected_verdict():
    assert exact_statements.STATEMENTS.keys() | numeric_statements.STATEMENTS.keys() == EXPECTED.keys()


@pytest.mark.parametrize(("statement", "opinion"), PROGRAM)
def test_second_program_reaches_the_committed_verdict_and_its_numbers(statement, opinion):
    verdict, phrases = opinion()
    assert verdict == COMMITTED[statement]["verdict"] == EXPECTED[statement]
    assert bool(phrases) == (statement in NUMBERS)
    assert [phrase for phrase in phrases if phrase not in COMMITTED[statement]["value"]] == []


def test_second_program_imports_nothing_of_the_package():
    allowed = sys.stdlib_module_names | {"mpmath", "numpy"}
    files = list((ROOT / "tests/support/second_opinion").glob("*.py"))
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    imported = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
    roots = {name.partition(".")[0] for name in imported if not name.startswith("support.second_opinion")}
    assert "numpy" in roots
    assert roots <= allowed
