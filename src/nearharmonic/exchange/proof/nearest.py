"""Search for the registered method nearest to given coefficients, for any roles, direction and scale.

A step and its reversed step have the same distance to a palindrome. A registered method that is no palindrome is
compared in both directions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from nearharmonic.exact.step import Step
from nearharmonic.exact.words import LETTERS
from nearharmonic.exchange.composition import step_of, with_roles_exchanged
from nearharmonic.integrators import plain_integrators
from nearharmonic.integrators.tableau import Tableau

#: Fraction of the coefficients that must agree so that the others count as wrong digits of the method.
MOST = Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """Comparison of a registered method with a step.

    Attributes
    ----------
    tableau : Tableau
        The method.
    exchanged, reversed, rescaled : bool
        Changes of the method before the comparison: roles exchanged, direction reversed, and rows multiplied by the
        sums of the rows of the step.
    differing : tuple of (str, Fraction, Fraction)
        Position, value, and value in the method (in the scale of the step) of each coefficient that differs by more
        than the digits of both allow.
    distance : Fraction
        The largest difference of two coefficients.
    compared : int
        Number of coefficients that were compared.
    """

    tableau: Tableau
    exchanged: bool
    reversed: bool
    rescaled: bool
    differing: tuple[tuple[str, Fraction, Fraction], ...]
    distance: Fraction
    compared: int

    @property
    def is_same(self) -> bool:
        """True if all coefficients are those of the method, to the digits of both."""
        return not self.differing

    @property
    def is_recognised(self) -> bool:
        """True if enough coefficients agree, so that the differing ones look wrong."""
        return len(self.differing) <= MOST * self.compared


def nearest(step: Step) -> Likeness | None:
    """Return the registered splitting method with the most equal coefficients and the smallest difference.

    Returns
    -------
    Likeness or None
        None if no method has as many flows.
    """
    found = [likeness for tableau in plain_integrators.values() for likeness in _likenesses(step, tableau)]
    # Candidates with fewer changes come first, and min returns the first of equal candidates.
    return min(found, key=lambda one: (len(one.differing), one.distance), default=None)


def _likenesses(step: Step, tableau: Tableau) -> Iterator[Likeness]:
    registered = step_of(tableau.kick, tableau.drift, tableau.first, tableau.digits)
    if len(registered) != len(step):
        return
    directions = (False,) if tableau.symmetric else (False, True)
    for (scale, rescaled), backwards, exchanged in product(_scales(step), directions, (False, True)):
        other = with_roles_exchanged(registered) if exchanged else registered
        other = other[::-1] if backwards else other
        if other[0][0] == step[0][0]:
            differing, distance = _difference(step, other, scale)
            yield Likeness(
                tableau=tableau,
                exchanged=exchanged,
                reversed=backwards,
                rescaled=rescaled,
                differing=differing,
                distance=distance,
                compared=len(step),
            )


def _scales(step: Step) -> Iterator[tuple[dict[str, Fraction], bool]]:
    """Return factors of drifts and kicks: 1, and the sums of the rows of the step if these clearly differ from 1."""
    yield dict.fromkeys(LETTERS, Fraction(1)), False
    sums = {letter: sum((c for x, c in step if x == letter), Fraction(0)) for letter in LETTERS}
    if all(sums.values()) and any(abs(x - 1) > Fraction(1, 10**6) for x in sums.values()):
        yield sums, True


def _difference(
    step: Step, other: Step, scale: dict[str, Fraction]
) -> tuple[tuple[tuple[str, Fraction, Fraction], ...], Fraction]:
    differing, largest = [], Fraction(0)
    for (letter, a), (_, b) in zip(step, other, strict=True):
        expected = b * scale[letter]
        distance = abs(a - expected)
        largest = max(largest, distance)
        if distance > a.uncertainty + b.uncertainty * abs(scale[letter]):
            differing.append((a.place, a, expected))
    return tuple(differing), largest
