"""Orders of an integrator, proved in exact arithmetic, and Nielsen's decomposition of a step."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import lru_cache
from itertools import count, pairwise
from math import sqrt
from numbers import Integral
from typing import Any, NamedTuple

from nearharmonic.errors import TableauError, bad_setting
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.words import logarithm, words
from nearharmonic.integrators.tableau import HIGHEST_ORDER, First, Tableau
from nearharmonic.numerics.written import is_real
from nearharmonic.theory.order_conditions import HIGHEST_DECLARED, errors_of, proved_order, step_of, tolerance, weighted
from nearharmonic.theory.oscillator import method_of, rotation_errors, tableau_of

# --- Orders of an integrator, proved from its printed coefficients in exact arithmetic, and its leading error terms.

#: Order up to which methods are examined by default; the number of words doubles with each order.
HIGHEST = 8


class ErrorTerm(NamedTuple):
    """An error term tau^degree, and its norm."""

    degree: int
    norm: float


class LeadingErrors(NamedTuple):
    """First nonzero error terms: for any separable H, for quadratic T, and for H = (p^2 + q^2)/2.

    The first two are terms of the logarithm of a step, with norms in the Lyndon basis; the third is the first power of
    tau at which the step matrix differs from the exact rotation, with the Frobenius norm of the difference.
    """

    general: ErrorTerm
    nystrom: ErrorTerm
    harmonic: ErrorTerm


class HarmonicOrders(NamedTuple):
    """Orders on H = (p^2 + q^2)/2: of the new position, of the new momentum, of the energy and of the phase.

    Position and momentum are exact to tau^order after one step. The energy error is O(tau^order) at all times. The
    phase error is O(tau^(order + 1)) per step.
    """

    position: int
    momentum: int
    energy: int
    phase: int


def order_of(
    integrator: str | Tableau,
    *,
    first: First | None = None,
    highest: int | None = None,
    potential_degree: int | None = None,
) -> int:
    """Return the order for every separable H = T(p) + V(q), or ``highest`` if the order is larger.

    Methods with modified potentials need a quadratic T, so that their order is the order for quadratic T. With a
    ``potential_degree`` it is the order for every H with quadratic T and a polynomial V of at most this degree:
    brackets with higher derivatives of V vanish, and fewer conditions are left. A collocation method has the order of
    its quadrature (Hairer, Lubich & Wanner 2006, Theorem II.1.5).

    Parameters
    ----------
    integrator : str or Tableau
        Method, or its name.
    first : {"drift", "kick"}, optional
        Operator to which the outer row is given; None leaves it as declared.
    highest : int, optional
        Order up to which conditions are examined; None is 8, or the order that the tableau declares if that is 9 or 10.
    potential_degree : int, optional
        Degree of V, from 2; None is for every V.

    Returns
    -------
    int
        The order, proved from the printed coefficients in exact arithmetic.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``first`` is no operator, ``highest`` no integer >= 1, or ``potential_degree`` no integer >= 2.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> nh.order_of("yoshida_s7o6a")
    6
    >>> nh.order_of("abas5o6h"), nh.order_of("abas5o6h", potential_degree=2)
    (4, 6)
    """
    if (method := method_of(integrator)).implicit:
        return int(min(method.role(first).proved_order, highest or HIGHEST_ORDER))
    tableau = tableau_of(integrator, first)
    if potential_degree is not None and _integer("potential_degree", potential_degree) < 2:
        raise bad_setting("potential_degree", potential_degree, "an integer from 2, the degree of a polynomial V")
    return proved_order(
        tableau, _highest(tableau, highest), quadratic=tableau.modified, potential_degree=potential_degree
    )


def nystrom_order_of(integrator: str | Tableau, *, first: First | None = None, highest: int | None = None) -> int:
    """Return the order for every H = T(p) + V(q) with quadratic T, or ``highest`` if it is larger; see
    :func:`order_of`.
    """
    tableau = tableau_of(integrator, first)
    return proved_order(tableau, _highest(tableau, highest), quadratic=True)


def harmonic_order(integrator: str | Tableau, *, first: First | None = None) -> int:
    """Return the harmonic order lambda_H.

    One step on the harmonic oscillator gives the exact position up to tau^lambda_H. This is Nielsen's definition:
    kappa_1 to kappa_lambda_H vanish (2015, Eq. 17).

    Parameters
    ----------
    integrator : str or Tableau
        Method, or its name.
    first : {"drift", "kick"}, optional
        Operator to which the outer row is given; None leaves it as declared.

    Returns
    -------
    int
        Harmonic order, at least the order.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``first`` is no operator.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> nh.order_of("babps8o7h"), nh.harmonic_order("babps8o7h")
    (4, 7)
    """
    if (method := method_of(integrator)).implicit:  # its step is the diagonal Pade approximant of the rotation
        return int(method.role(first).proved_order)
    return harmonic_orders_of(integrator, first=first).position


def harmonic_orders_of(integrator: str | Tableau, *, first: First | None = None) -> HarmonicOrders:
    """Return the orders of position, momentum, energy and phase on the harmonic oscillator.

    Arguments and errors are as for :func:`order_of`.
    """
    tableau = tableau_of(integrator, first)
    return HarmonicOrders(
        position=_first_power(tableau, lambda K11, K12, K21, K22: (K11, K12)) - 1,
        momentum=_first_power(tableau, lambda K11, K12, K21, K22: (K21, K22)) - 1,
        # The conserved ellipse -K21 q^2 + (K11 - K22) q p + K12 p^2 is a circle except for K12 + K21 and K11 - K22; one
        # power of tau cancels. The error of the trace 2 cos(phase) is 2 sin(tau) times the error of the phase.
        energy=_first_power(tableau, lambda K11, K12, K21, K22: (K12 + K21, K11 - K22)) - 1,
        phase=_first_power(tableau, lambda K11, K12, K21, K22: (K11 + K22,)) - 2,
    )


def generalised_order_of(
    integrator: str | Tableau, *, quadratic: bool = False, first: First | None = None
) -> tuple[int, ...]:
    """Return the generalised order (r1, r2, ..., rm) for H = T(p) + epsilon V(q), in which the kick is the small part.

    The error is O(epsilon tau^(r1 + 1) + epsilon^2 tau^(r2 + 1) + ...). The terms from epsilon^m on are O(tau^(rm +
    1)), and rm is the order (Blanes et al. 2013, section 2). No r is larger than the previous one, because the
    errors of the previous one would hide its errors. r1 is at most 2s, as for a quadrature with s nodes. If T is
    ``quadratic``, error terms with three or more kicks vanish or combine. Other arguments are as for
    :func:`order_of`.
    """
    tableau = tableau_of(integrator, first)
    highest = 2 * tableau.stages
    order, orders = proved_order(tableau, highest, quadratic=quadratic), [highest]
    for kicks in range(1, order + 2):
        # A quadratic T removes no error term with one or two kicks: [B, [B, [B, A]]] has three.
        fails = _first_nystrom_failure if quadratic and kicks > 2 else _first_failure
        orders.append(fails(tableau, kicks, orders[-1]))
        if orders[-1] <= order:
            break
    return tuple(orders[1:])


def leading_errors(
    integrator: str | Tableau, *, first: First | None = None, highest: int | None = None
) -> LeadingErrors:
    """Return the leading error terms of a step, with the arguments of :func:`order_of`.

    The first two norms are Euclidean norms of the coordinates in the Lyndon basis with its standard bracketing (A < B,
    drift A, kick B). The norm for quadratic kinetic energy is the norm of the smallest equivalent error; it is at most
    the first norm if both have the same degree.
    """
    tableau = tableau_of(integrator, first)
    terms, most = [], _highest(tableau, highest)
    for quadratic in (False, True):
        order = proved_order(tableau, most + 1, quadratic=quadratic)
        if order > most:
            raise bad_setting("highest", most, f"the order of {tableau.name} is larger")
        terms.append(ErrorTerm(order + 1, error_norm(tableau, order + 1, quadratic=quadratic)))
    general, nystrom = terms
    degree = _first_power(tableau, lambda *K: K)
    norm = sqrt(sum((entry**2 for entry in rotation_errors(tableau, degree)), Fraction(0)))
    return LeadingErrors(general, nystrom, ErrorTerm(degree, norm))


def error_norm(integrator: str | Tableau, degree: int, *, quadratic: bool = False, first: First | None = None) -> float:
    """Return the norm of the error term tau^``degree``, from 1, with the norm of :func:`leading_errors`.

    Below the order the norm is the rounding error of the printed digits.
    """
    tableau = tableau_of(integrator, first)
    errors = errors_of(tableau, _integer("degree", degree))
    rows = conditions(degree, quadratic=quadratic)
    return sqrt(sum((weighted(row, errors) ** 2 / row.scale for row in rows), Fraction(0)))


@lru_cache(maxsize=512)
def _first_failure(tableau: Tableau, kicks: int, highest: int) -> int:
    """Return the order of the first error term with exactly ``kicks`` letters B, at most ``highest``."""
    length = min(highest, tableau.order + 1)
    while True:
        # On words of even length the logarithm of a symmetric step vanishes.
        wanted = [w for w in words(length, kicks) if w.count("B") == kicks and (len(w) % 2 or not tableau.symmetric)]
        found = logarithm(step_of(tableau), wanted)
        failing = [len(word) - 1 for word in wanted if abs(found[word] - (word == "B")) > tolerance(tableau, len(word))]
        if failing or length == highest:
            return min(failing, default=highest)
        length = min(highest, length + 4)


def _first_nystrom_failure(tableau: Tableau, kicks: int, highest: int) -> int:
    """Return the value of :func:`_first_failure` for quadratic T."""
    for degree in range(kicks, highest + 1):
        errors, allowed = errors_of(tableau, degree), tolerance(tableau, degree)
        counts = [word.count("B") for word in lyndon_words(degree)]
        for row in conditions(degree, quadratic=True):
            # Each condition has words with the same number of kicks.
            if any(counts[i] == kicks for i in row.numbers) and abs(weighted(row, errors)) > allowed:
                return degree - 1
    return highest


def _first_power(tableau: Tableau, of: Callable[..., tuple[Fraction, ...]]) -> int:
    """Return the first power of tau at which a number ``of`` the errors K11, K12, K21 and K22 of the step matrix is not
    zero within the guaranteed digits: two powers beyond the step's own at the latest.

    A matrix entry is the sum of all words of n letters of the step. The total error of these words is at most m
    10^-digits M^(n-1) / (n-1)!, which is less than the error allowed for their logarithm.
    """
    found = ((n, of(*rotation_errors(tableau, n)), 2 * tolerance(tableau, n)) for n in count(1))
    return next(n for n, errors, allowed in found if any(abs(x) > allowed for x in errors if x))


def _highest(tableau: Tableau, asked: int | None) -> int:
    return max(HIGHEST, min(tableau.order, HIGHEST_DECLARED)) if asked is None else _integer("highest", asked)


def _integer(key: str, number: Any) -> int:
    if not is_real(number) or not isinstance(number, Integral) or number < 1:
        raise bad_setting(key, number, "an integer >= 1")
    return int(number)


# --- Nielsen's decomposition of a step on the oscillator: the recursion of Table 2, the closed sums of Table 3.
#
# With m = k = 1 the momentum is eliminated from the step (2015, Eq. 6): the position after the h-th drift c_h is
#
#     q_h = q_(h-1) (1 + C_h) - C_h q_(h-2) + tau^2 D_h q_(h-1),    C_h = c_h / c_(h-1),    D_h = -c_h d_h,
#
# where d_h is the kick just before that drift. Q_(h,lambda) is the coefficient of tau^lambda, in units of q_a for even
# and of p_a for odd lambda. The paper prints C_h = c_(h+1)/c_h below Eq. 6, which contradicts its own Eq. 6.
#
# The paper treats the BAB composition, which begins with a kick. The ABA composition has no kick before the first
# drift: all formulas of the paper hold for it with the kicks (0, d_1, ..., d_s). All numbers here are exact.

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

    There is a row for each h = 0, 1, ... (s drifts for BAB, s + 1 for ABA), with lambda = 0, ..., lambda_max. The
    recursion divides by each drift before the last, which must not be 0. Arguments are as for
    :func:`nearharmonic.kappa`.
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

    The momentum follows from the last drift, which must not be 0, p = (q_h - q_(h-1)) / (tau c_h), and for BAB from one
    more kick. Odd powers are in units of q_a, even powers in units of p_a.
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
    """Return the rows h = 0, 1, ... of Table 3."""
    d, c = kicks_and_drifts(tableau_of(integrator, first))
    tau2 = [-_sum(c[i] * _sum(d[: i + 1]) for i in range(h)) for h in range(len(c) + 1)]

    def tau4(h: int, limit: int) -> Fraction:
        return -_sum(tau2[m] * d[m] * _sum(c[m:limit]) for m in range(1, h))

    return [ClosedSums(Fraction(1), tau2[h], tau4(h, h), tau4(h, h - 1)) for h in range(len(c) + 1)]


def kicks_and_drifts(tableau: Tableau) -> tuple[Powers, Powers]:
    """Return the drifts c_1, c_2, ..., and first, for each, the kick d_h just before it: 0 before the first drift of
    ABA.
    """
    kicks, drifts, _ = map(list, tableau.exact_rows)
    return (kicks[: len(drifts)] if tableau.first == "kick" else [Fraction(0), *kicks]), drifts


def _sum(numbers: Iterable[Fraction]) -> Fraction:
    return sum(numbers, Fraction(0))
