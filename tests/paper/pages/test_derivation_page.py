"""docs/results/derivation.md: its parts are those of the recorded results, and its text has their numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from decimal import Decimal, localcontext
from inspect import signature

import pytest

import nearharmonic as nh
from nearharmonic.integrators.tableau import palindrome
from nearharmonic_paper.experiments.derivation import run
from nearharmonic_paper.experiments.derivation.search.simplex import Simplex
from nearharmonic_paper.pages.targets import derivation
from nearharmonic_paper.pages.trained import tables_of
from support.results.recorded_results import unpack
from support.results.stated_numbers import ROOT, flat, numbers, states

PLACE = "docs/results/derivation.md"
VALUES = {entry["id"]: entry["value"] for entry in json.loads((ROOT / "docs/claims.json").read_text(encoding="utf-8"))}


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """Tables of the target, as they are recorded."""
    folder = unpack(tmp_path_factory.mktemp("recorded"))
    return [str(path) for path in folder.glob("tables/derived_*.csv")]


def test_parts_of_the_page_are_those_of_recorded_results(paths):
    assert derivation.page(str(ROOT / PLACE), paths, ())["page"] == (ROOT / PLACE).read_text(encoding="utf-8")


def test_what_the_page_says_of_solutions_holds_in_their_table(paths):
    tables = tables_of(paths, "derived_")
    assert {row["complete"] for row in tables["counts"]} == {"yes"}
    row = tables["counts"][0]
    found = [row[key] for key in ("harmonic order", "complex solutions", "real solutions by Sturm")]
    assert states("docs/results/index.md", found, "equations for five stages")
    assert VALUES["four-unique-sets"] == "4 of 4 sets"
    rows = [line.split("|")[1:-1] for line in derivation.solutions(tables).splitlines()[2:]]
    named = [name.strip() != "" for _, _, name, _ in rows]
    assert named.count(False) == 1
    errors = [float(row["max error, harmonic oscillator"]) for row in tables["errors"] if row["tau/s"] == 0.05]
    assert errors.index(max(errors)) // 2 == named.index(False)  # each drift first and kick first
    assert states(PLACE, [derivation.TAU_PER_STAGE], "independent coefficients", "drift first")


def test_digits_and_bits_of_the_derivation_are_stated():
    digits = signature(run.derive).parameters["digits"].default
    assert states(PLACE, [digits], "refined to", "Krawczyk")
    assert states(PLACE, [digits], "proved and extended")
    assert states(PLACE, [Simplex().bits], "adaptive simplex")


def moved(row, index, units):
    """A row of a method with one independent coefficient moved by last units; the last of its half keeps the sum."""
    half = [*row[: len(row) // 2]]
    odd = len(row) % 2
    with localcontext(prec=100):
        half[index] = str(Decimal(half[index]) + units * Decimal("1e-76"))
        rest = Decimal("0.5") - sum(map(Decimal, half[: len(half) - 1 + odd]), Decimal(0))
        return palindrome(*half, centre=str(2 * rest)) if odd else palindrome(*half[:-1], str(rest))


def largest_terms(name, part, index):
    """The largest of the terms that vanish, for a coefficient that is moved by up to 12 units."""
    tableau = nh.integrators[name]
    row = getattr(tableau, part)
    for units in range(-12, 13):
        yield max(nh.kappa(replace(tableau, **{part: moved(row, index, units)}), 7))


def test_one_printed_decimal_is_wrong_and_no_other_can_be():
    stated = numbers(
        flat(PLACE),
        r"the (\d+)th decimal of c\(3\) of BAB's8o7H is (\d), not (\d): the largest of κ₁ to κ₇ falls from (\S+ × \S+) "
        r"to (\S+ × \S+?)\. No other coefficient, moved by up to (\d+) units of its last decimal, brings it below "
        r"(\S+ × \S+?)\.",
    )
    decided = numbers(VALUES["table-4-c3"], r"decimal (\d+) is (\d), not (\d); .* is (\S+ × \S+) in place of (.*)$")
    assert stated[:5] == [*decided[:3], decided[4], decided[3]]
    assert stated[5] == 12
    others = [("kick", 0), ("kick", 1), ("kick", 2), ("kick", 3), ("drift", 0), ("drift", 1)]
    least = min(min(largest_terms("babps8o7h", *one)) for one in others)
    assert stated[6] <= least < 1.1 * stated[6]


def test_the_counterexample_has_the_stated_term():
    assert states(PLACE, numbers(VALUES["eq-16-general"], r"but κ₃ = (\S+)"), "d₁ + d₂", "solves it")
