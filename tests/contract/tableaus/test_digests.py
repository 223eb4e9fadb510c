"""Digests of coefficients: each number of each row counts, and which operator comes first."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, localcontext

import pytest

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.reproduction.tasks.provenance import coefficients_digest


def nudged(tableau, row, i):
    """``tableau`` with entry i of ``row`` and its mirror image changed below the last decimal that its source vouches
    for, which the tableau cannot tell from rounding."""
    values = list(getattr(tableau, row))
    change = Decimal(10) ** (-tableau.digits - 3)
    with localcontext(prec=400):
        for k in {i, len(values) - 1 - i} if tableau.symmetric else {i}:
            values[k] = f"{Decimal(values[k]) + change:f}"
    return replace(tableau, **{row: tuple(values)})


@pytest.mark.parametrize("name", plain_integrators)
def test_every_row_entry_and_first_operator_count(name):
    tableau = nh.integrators[name]
    other = tableau.role("drift" if tableau.first == "kick" else "kick")
    changed = [tableau, other]
    for row in ("kick", "drift"):
        changed += [nudged(tableau, row, i) for i in range((len(getattr(tableau, row)) + 1) // 2)]
    assert len(changed) == 2 + tableau.stages + 1  # of 2 s + 1 numbers every second is a mirror image
    assert len({one.digest() for one in changed}) == len(changed)
    assert len({coefficients_digest([one]) for one in changed}) == len(changed)


def test_what_does_not_change_run_does_not_change_digest():
    ruth = nh.integrators["ruth"]
    assert replace(ruth, label="another", source="elsewhere", note="none").digest() == ruth.digest()
