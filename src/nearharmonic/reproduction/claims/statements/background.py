"""Section 1: methods of every even order, and methods with modified kicks and positive coefficients alone."""

from __future__ import annotations

from mpmath import mp, mpf

from nearharmonic.integrators.modified import chin_1997, omelyan_2002, rowlands_1991
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.reproduction.claims.claim import Decision, claim, counted, either
from nearharmonic.reproduction.claims.results import Results
from nearharmonic.theory.order import order_of

#: Methods with modified kicks that are older than the paper.
FORCE_GRADIENT = tuple(one for module in (rowlands_1991, chin_1997, omelyan_2002) for one in module.TABLEAUS)
#: Even orders that are tried: the free Lie algebra grows by a factor four from one to the next.
ORDERS = (2, 4, 6, 8)


@claim(
    id="every-even-order",
    paper="Section 1",
    sentence="SIs of arbitrarily high even order exist and can be constructed using Lie algebra",
    kind="background",
    statement="Composing a method three times raises its order by two, again and again",
    threshold="orders 2, 4, 6 and 8 of the leapfrog composed with the weights 1/(2 - 2^(1/n)), n = 3, 5 and 7, "
    "proved in the free Lie algebra",
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
        halves = [(a + b) / 2 for a, b in zip([mpf(0), *weights], [*weights, mpf(0)], strict=True)]
        rows = [[mp.nstr(c, 50) for c in row] for row in (weights, halves)]
    kicks, drifts = rows
    middle = len(kicks) // 2
    return Tableau(
        name=f"tripled_o{order}", label=f"leapfrog, order {order}", order=order, first="drift", digits=45,
        kick=palindrome(*kicks[:middle], centre=kicks[middle]), drift=palindrome(*drifts[: middle + 1]),
        source="Yoshida (1990), doi:10.1016/0375-9601(90)90092-3",
    )  # fmt: skip


@claim(
    id="positive-force-gradient",
    paper="Section 1",
    sentence="The force-gradient compositions benefit from all-positive splitting coefficients",
    kind="background",
    statement="Methods of order four with kicks of a modified potential have positive coefficients alone",
    threshold="no coefficient below 0 in one of the methods of order four of Rowlands (1991), Chin (1997) and "
    "Omelyan et al. (2002) or more: a plain splitting of that order has a negative one",
)
def positive_force_gradient(_: Results) -> Decision:
    high = [m for m in FORCE_GRADIENT if m.order == 4]
    forward = [m.label for m in high if all(float(c) >= 0 for c in (*m.kick, *m.drift))]
    return either(bool(forward), f"{len(forward)} of {len(high)} methods of order four: {', '.join(forward)}")
