"""The ten methods for expensive proofs in README's command: one of each registered kind."""

from __future__ import annotations

from nearharmonic.integrators import integrators
from support.methods.ten_methods import TEN_METHODS

#: Each tells methods apart; the ten have all of its values, orders of eight and more counted as one.
KINDS = (
    lambda tableau: tableau.symmetric,
    lambda tableau: tableau.first,
    lambda tableau: tableau.requires,
    lambda tableau: tableau.benchmarked,
    lambda tableau: tableau.harmonic_order is None,
    lambda tableau: tableau.generalised_order is None,
    lambda tableau: tableau.order % 2,
    lambda tableau: min(tableau.order // 2, 4),
    lambda tableau: tableau.digits < 18,
    lambda tableau: tableau.name.startswith("trained_"),
    lambda tableau: any(text.startswith("-") for text in tableau.kick + tableau.drift),
)


def test_the_ten_methods_are_ten_and_of_every_registered_kind():
    assert len(TEN_METHODS) == 10
    ten = [integrators[name] for name in TEN_METHODS]
    for kind in KINDS:
        assert {kind(tableau) for tableau in ten} == {kind(tableau) for tableau in integrators.values()}
