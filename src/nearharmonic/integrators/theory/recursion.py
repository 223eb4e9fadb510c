"""Nielsen's decomposition of a step on the harmonic oscillator: the recursion of Table 2, the closed sums of Table 3.

With m = k = 1 the momentum is eliminated from the step (2015, Eq. 6): the position after the h-th drift c_h is

    q_h = q_(h-1) (1 + C_h) - C_h q_(h-2) + tau^2 D_h q_(h-1),    C_h = c_h / c_(h-1),    D_h = -c_h d_h,

where d_h is the kick just before that drift. Q_(h,lambda) is the coefficient of tau^lambda, in units of q_a for even
and of p_a for odd lambda. The paper prints C_h = c_(h+1)/c_h below Eq. 6, which contradicts its own Eq. 6.

The paper treats the BAB composition, which begins with a kick. The ABA composition has no kick before the first drift:
all formulas of the paper hold for it with the kicks (0, d_1, ..., d_s). All numbers here are exact.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from nearharmonic.errors import TableauError
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.integrators.theory.oscillator import tableau_of

Powers = list[Fraction]


class ClosedSums(NamedTuple):
    """Row h of Table 3, for q_a = 1 and p_a = 0: contributions of orders 0, 2 and 4 to the position after drift h.

    ``tau4`` has the upper limit h of Eq. 16 in its inner sum; ``tau4_as_printed`` has the h - 1 of Table 3, which
    leaves the last drift out and is wrong.
    """

    tau0: Fraction
    tau2: Fraction
    tau4: Fraction
    tau4_as_printed: Fraction


def position_rows(integrator: str | Tableau, *, first: First | None = None) -> list[Powers]:
    """Return Q_(h,lambda) of Table 2, the contribution of each power of tau to the position after drift h.

    Parameters
    ----------
    integrator, first
        As for :func:`nearharmonic.kappa`, as are the errors.

    Returns
    -------
    list of list of Fraction
        One row for each h = 0, 1, ... (s drifts for BAB, s + 1 for ABA), with lambda = 0, ..., lambda_max.

    Raises
    ------
    TableauError
        A drift before the last is 0: the recursion divides by it.
    """
    tableau = tableau_of(integrator, first)
    kicks, drifts = kicks_and_drifts(tableau)
    width = 2 * len(drifts) + (tableau.first == "kick")
    one, none = Fraction(1), Fraction(0)
    start = [one, *[none] * (width - 1)]
    rows = [start, [one, drifts[0], *[none] * (width - 2)]]
    if width > 2:
        rows[1][2] = -drifts[0] * kicks[0]
    for h, (before, drift) in enumerate(pairwise(drifts), start=2):
        if before == 0:
            message = f"tableau {tableau.name!r}: drift[{h - 2}] = 0, by which the recursion of Table 2 divides"
            raise TableauError(message)
        C, D = drift / before, -drift * kicks[h - 1]
        force = [none, none, *rows[-1]]
        rows.append([(1 + C) * a - C * b + D * f for a, b, f in zip(rows[-1], rows[-2], force, strict=False)])
    return rows


def momentum_row(integrator: str | Tableau, *, first: First | None = None) -> Powers:
    """Return the contribution of each power of tau to the new momentum: the last line of Eq. 6.

    The momentum follows from the last drift, p = (q_h - q_(h-1)) / (tau c_h), and for BAB from one more kick.

    Odd powers are in units of q_a, even powers in units of p_a. Arguments and errors are those of
    :func:`position_rows`.

    Raises
    ------
    TableauError
        The last drift is 0.
    """
    tableau = tableau_of(integrator, first)
    before, last = position_rows(tableau)[-2:]
    drift = Fraction(tableau.drift[-1])
    if drift == 0:
        raise TableauError(f"tableau {tableau.name!r}: drift[{len(tableau.drift) - 1}] = 0, by which Eq. 6 divides")
    drifting = [(a - b) / drift for a, b in zip(last, before, strict=True)][1:]
    if tableau.first == "drift":
        return drifting
    kick, none = Fraction(tableau.kick[-1]), Fraction(0)
    return [a - kick * b for a, b in zip([*drifting, none, none], [none, *last], strict=True)]


def closed_sums(integrator: str | Tableau, *, first: First | None = None) -> list[ClosedSums]:
    """Return the rows h = 0, 1, ... of Table 3.

    Arguments and errors are those of :func:`position_rows`.
    """
    d, c = kicks_and_drifts(tableau_of(integrator, first))
    tau2 = [-_sum(c[i] * _sum(d[: i + 1]) for i in range(h)) for h in range(len(c) + 1)]

    def tau4(h: int, limit: int) -> Fraction:
        return -_sum(tau2[m] * d[m] * _sum(c[m:limit]) for m in range(1, h))

    return [ClosedSums(Fraction(1), tau2[h], tau4(h, h), tau4(h, h - 1)) for h in range(len(c) + 1)]


def kicks_and_drifts(tableau: Tableau) -> tuple[Powers, Powers]:
    """Return the drifts and, for each, the kick just before it.

    Returns
    -------
    kicks, drifts : list of Fraction
        d_1, d_2, ..., with 0 before the first drift of ABA; and c_1, c_2, ...
    """
    kicks, drifts = [Fraction(d) for d in tableau.kick], [Fraction(c) for c in tableau.drift]
    return (kicks[: len(drifts)] if tableau.first == "kick" else [Fraction(0), *kicks]), drifts


def _sum(numbers: Iterable[Fraction]) -> Fraction:
    return sum(numbers, Fraction(0))
