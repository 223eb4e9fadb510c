"""Section 1: methods of every even order, and methods with the force gradient and only positive coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import mp, mpf

from nearharmonic.integrators.modified import chin_1997, omelyan_2002, rowlands_1991
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.reproduction.claims.claim import Decision, background, counted, tallied
from nearharmonic.reproduction.claims.results import Results
from nearharmonic.theory.order import order_of

#: Methods with modified kicks that are older than the paper.
FORCE_GRADIENT = tuple(one for module in (rowlands_1991, chin_1997, omelyan_2002) for one in module.TABLEAUS)
#: Even orders that are tried: the free Lie algebra grows by a factor four from one to the next.
ORDERS = (2, 4, 6, 8)


@background(
    id="every-even-order",
    paper="Section 1",
    sentence="SIs of arbitrarily high even order exist and can be constructed using Lie algebra",
    statement="Composing a method three times with itself raises its order by two, any number of times",
    threshold="the leapfrog has order 2, and its compositions with the weights 1/(2 - 2^(1/n)), n = 3, 5 and 7, have "
    "the orders 4, 6 and 8, proved in the free Lie algebra",
)
def every_even_order(_: Results) -> Decision:
    found = [order_of(tripled(order), highest=order + 1) for order in ORDERS]
    return counted([a == b for a, b in zip(found, ORDERS, strict=True)], f"proved orders {', '.join(map(str, found))}")


def tripled(order: int) -> Tableau:
    """The leapfrog composed three times with itself until it is of this order (Yoshida 1990, Eq. 4.14)."""
    with mp.workdps(60):
        weights = [mpf(1)]
        for n in range(3, order, 2):
            outer = 1 / (2 - mp.root(2, n))
            weights = [w * x for w in (outer, 1 - 2 * outer, outer) for x in weights]
        return leapfrogs(weights, name=f"tripled_o{order}", label=f"leapfrog, order {order}", order=order, digits=45)


def leapfrogs(weights: Sequence[Any], digits: int, **about: Any) -> Tableau:
    """Compose leapfrog steps with symmetric weights, each of which begins with a drift, in the precision of mpmath."""
    halves = [(a + b) / 2 for a, b in zip([mpf(0), *weights], [*weights, mpf(0)], strict=True)]
    kicks, drifts = ([mp.nstr(c, digits + 5) for c in row] for row in (weights, halves))
    middle = len(kicks) // 2
    kick, drift = palindrome(*kicks[:middle], centre=kicks[middle]), palindrome(*drifts[: middle + 1])
    source = "Yoshida (1990), doi:10.1016/0375-9601(90)90092-3"
    return Tableau(kick=kick, drift=drift, first="drift", digits=digits, source=source, **about)


@background(
    id="positive-force-gradient",
    paper="Section 1",
    sentence="The force-gradient compositions benefit from all-positive splitting coefficients",
    statement="Fourth order methods that evaluate the force gradient have only positive coefficients",
    threshold="no negative coefficient in either fourth order method, of Rowlands (1991) and of Chin (1997); a "
    "splitting of that order without the force gradient always has one",
)
def positive_force_gradient(_: Results) -> Decision:
    least = {m.label: min(float(c) for c in (*m.kick, *m.drift)) for m in FORCE_GRADIENT}
    fourth = [m.label for m in FORCE_GRADIENT if m.order == 4]
    forward = [one for one in fourth if least[one] >= 0]
    higher = [f"; {m.label}, of order {m.order}, has {least[m.label]:.2f}" for m in FORCE_GRADIENT if m.order > 4]
    listed = f"methods of order four: {', '.join(forward)}{''.join(higher)}"
    return tallied((one in forward for one in fourth), listed)
