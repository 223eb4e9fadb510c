"""Ten methods that stand for all registered ones where a proof on each would take too long for every run of the tests.

Exact algebra and multiprecision run on these ten in README's command, and on the others under the marker `slow`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from nearharmonic.integrators import plain_integrators

#: Name -> the kind of method that it stands for; the contract test of the same name checks that no kind is missing.
TEN_METHODS = {
    "leapfrog": "one stage, order two",
    "ruth": "negative coefficients in both rows, order four",
    "abas5o6h": "first a drift, with an even harmonic order",
    "babps9o7h": "first a kick, with an odd harmonic order; the paper's longest",
    "aba864": "a generalised order, so that the small part of H is known",
    "yoshida_s7o6a": "a composition of leapfrog steps, order six",
    "s15odr8": "many stages, order eight",
    "mclachlan_atela_5": "not symmetric, of odd order, Nystrom, with few digits",
    "srkn_b11": "symmetric, Nystrom, order six",
    "trained_light": "trained: no condition beyond order four, coefficients without a pattern",
}


def thinned(cases: Iterable[str | tuple[str, ...]]) -> list[Any]:
    """Cases of a test, each a name or a tuple that begins with one: those beyond the ten methods are slow."""
    rows = [(case,) if isinstance(case, str) else case for case in cases]
    return [pytest.param(*row, marks=[pytest.mark.slow] * (row[0] not in TEN_METHODS)) for row in rows]


#: The oracles of these tests compose plain kicks and drifts.
EVERY_METHOD = pytest.mark.parametrize("name", thinned(plain_integrators))
