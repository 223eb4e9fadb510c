"""Committed verdicts against the verdicts of a second program, and their numbers, computed in another way."""

import ast
import json
import sys
from dataclasses import replace
from fractions import Fraction

import pytest

import nearharmonic as nh
from support.results import stated_numbers
from support.results.stated_numbers import ROOT
from support.second_opinion import exact_statements, numeric_statements
from support.second_opinion.exact_statements import position_errors
from support.second_opinion.methods import METHODS

# --- twelve committed verdicts against a second program, which shares no code with the package ------------------------


COMMITTED = {entry["id"]: entry for entry in json.loads((ROOT / "docs/claims.json").read_text(encoding="utf-8"))}
EXPECTED = {
    "eq-14-only-solution": "holds", "table-3-inner-limit": "erratum", "eq-16-general": "fails",
    "bab-prime-leaves-q": "fails", "fig-1-sixth-order": "holds", "fig-2-even-orders-meet": "holds",
    "fig-2-kappa-7": "holds", "fig-3-sixth-order-descent": "holds in part", "fig-4-coincide": "holds but for edges",
    "fig-6-c-unstable": "holds", "outperform-ruth": "holds", "outperform-ruth-kepler": "fails",
}  # fmt: skip
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


# --- numbers of docs/claims.json, computed in another way -------------------------------------------------------------


VALUES = {name: entry["value"] for name, entry in COMMITTED.items()}


def numbers(statement, pattern):
    """Return the numbers that ``pattern`` finds once in the value of a statement."""
    return stated_numbers.numbers(VALUES[statement], pattern)


def test_largest_term_of_yoshida_is_that_of_its_step_matrix():
    (stated,) = numbers("fig-2-yoshida-diverges", r"Yosh s7o6 A (.*?), s9odr6a")
    terms = position_errors(METHODS["Yosh s7o6 A"])[1:]
    assert float(max(terms)) == pytest.approx(stated, rel=5e-3)  # three digits are stated


@pytest.mark.slow
def test_panel_d_stays_in_plane_and_leaves_beside_it():
    """Plain steps, written out here. The iteration at which the run diverges depends on rounding, so it differs."""
    (stated,) = numbers("fig-6-others-stable", r"\(D\) (\S+) in 100000 iterations in its plane$")
    tableau = nh.integrators["babs7o7h"]
    first, *kicks = (2 * float(d) for d in tableau.kick)
    pairs = [(2 * float(c), d) for c, d in zip(tableau.drift, kicks, strict=True)]
    y = p = 0.4
    lowest = highest = start = p * p / 2 + y * y / 2 - y**3 / 3
    for _ in range(300_000):
        p -= first * (y - y * y)
        for c, d in pairs:
            y += c * p
            p -= d * (y - y * y)
        energy = p * p / 2 + y * y / 2 - y * y * y / 3
        lowest, highest = min(lowest, energy), max(highest, energy)
    assert max(start - lowest, highest - start) / start == pytest.approx(stated, rel=1e-2)
    for displacement in (1e-3, 1e-2):
        x, u, y, p = displacement, 0.0, 0.4, 0.4
        for _ in range(100_000):
            x, u, y, p = _stepped((x, u, y, p), first, pairs)
            energy = (u * u + p * p + x * x + y * y) / 2 + x * x * y - y * y * y / 3
            if not abs(energy - start) <= start:
                break
        assert not abs(energy - start) <= start, displacement


def _stepped(state, first, pairs):
    """Return the state after a step that begins with a kick."""
    x, u, y, p = state
    u, p = u - first * (x + 2 * x * y), p - first * (y + x * x - y * y)
    for c, d in pairs:
        x, y = x + c * u, y + c * p
        u, p = u - d * (x + 2 * x * y), p - d * (y + x * x - y * y)
    return x, u, y, p


def test_no_coefficient_of_babs8o7h_except_c3_can_be_wrong():
    tableau = nh.integrators["babps8o7h"]
    rows = {"d": tableau.kick[:4], "c": tableau.drift[:3]}
    left = {}
    for symbol, i in [("d", 0), ("d", 1), ("d", 2), ("d", 3), ("c", 0), ("c", 1), ("c", 2)]:
        for units in range(-12, 13):
            moved = {key: [Fraction(text) for text in row] for key, row in rows.items()}
            moved[symbol][i] += Fraction(units, 10**76)
            d, c = moved["d"], moved["c"]
            whole = {"kick": (*d, 1 - 2 * sum(d), *d[::-1]), "drift": (*c, Fraction(1, 2) - sum(c))}
            whole["drift"] += whole["drift"][::-1]
            texts = {key: tuple(f"{int(x * 10**76)}e-76" for x in row) for key, row in whole.items()}
            left[symbol, i, units] = float(max(nh.kappa(replace(tableau, **texts), 7)))
    assert min(size for (symbol, i, _), size in left.items() if (symbol, i) != ("c", 2)) > 1.4e-74
    assert min(left, key=left.__getitem__) == ("c", 2, 10)
    stated = numbers("table-4-c3", r"is (\S+ × \S+) in place of (\S+ × \S+)$")
    assert [left["c", 2, 10], left["c", 2, 0]] == pytest.approx(stated, rel=0.03)
