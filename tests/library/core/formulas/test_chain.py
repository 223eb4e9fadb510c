"""The longest chain of a formula, against chains counted by hand from the table of latencies."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.core.formulas.chain import Chained, longest_chain
from nearharmonic.math import sin, sqrt

ROOT, KEPLER = Path(__file__).parents[4], nh.systems["kepler"]

# Cycles of the table: add 3, multiply and fused 4, divide 13, root 18, a function 50.
x, y, s = Chained(), Chained(), Chained()


@pytest.mark.parametrize(
    ("result", "operations"),
    [
        (x, ()), (x + y, (("add", 3),)), (-(x - y), (("add", 3),)), (x * y, (("multiply", 4),)),
        (x * y + s, (("fused", 4),)), (s - x * y, (("fused", 4),)), (s / 2 + 1, (("fused", 4),)),
        ((x + y) * s + x * y, (("multiply", 4), ("fused", 4))),
        (2 / s, (("divide", 13),)), (s / 3, (("divide", 13),)),
        (1 / (s * sqrt(s)), (("root", 18), ("multiply", 4), ("divide", 13))),
        (1 / (s * s) * sqrt(s), (("root", 18), ("multiply", 4))),
        (sin(x * y) + 1, (("multiply", 4), ("sin", 50), ("add", 3))),
        (abs(x) ** 3, (("abs", 1), ("multiply", 4), ("multiply", 4))),
    ],
)  # fmt: skip
def test_a_chain_is_that_counted_by_hand(result, operations):
    assert longest_chain([result]).operations == operations


def test_the_longest_of_several_results_counts_and_constants_have_none():
    chain = longest_chain([x + y, 1 / x, 3])
    assert (chain.cycles, chain.dominant) == (13, "divide")
    assert (longest_chain([0]).cycles, longest_chain([]).dominant) == (0, "")


def force_chain(system):
    return longest_chain(system.formulas().grad_V((x, y), *(Chained() for _ in system.parameters)))


def test_derived_gradient_chain_equals_hand_written_one():
    derived = replace(KEPLER, grad_V=None)
    assert force_chain(derived).cycles == force_chain(KEPLER).cycles == 34


def test_what_the_page_says_of_chains_is_so():
    text = (ROOT / "docs/how_to/formulas.md").read_text(encoding="utf-8")
    assert str(force_chain(KEPLER)) in text
    behind = nh.System(
        name="behind", V=lambda q: -1 / sqrt(q[0] * q[0] + q[1] * q[1]), q0=(1, 0), p0=(0, 1), t_end=1,
        grad_V=lambda q: tuple(z / ((q[0] * q[0] + q[1] * q[1]) * sqrt(q[0] * q[0] + q[1] * q[1])) for z in q),
    )  # fmt: skip
    # The position multiplies the quotient, as in the text, and not the division's numerator.
    assert force_chain(behind).cycles + 4 == int(re.search(r"takes (\d+), because", text)[1])
