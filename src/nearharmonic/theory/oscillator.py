"""One step on the harmonic oscillator H = (p^2 + q^2)/2: its decomposition by powers of tau, and its stability.

The step is a linear map (q, p) -> K (q, p) whose entries are polynomials in tau: a drift by c is the shear q += c tau
p, a kick by d the shear p -= d tau q. Every coefficient of a tableau is a decimal number, so the polynomials are
rational and have no rounding errors. mpmath only evaluates them at a step size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import factorial
from numbers import Integral
from typing import Any, Literal, NamedTuple

from mpmath import acosh, inf, isfinite, isinf, mp, mpf, sqrt

from nearharmonic.errors import bad_setting
from nearharmonic.exact.polynomials import (
    BigFloat,
    as_mpf,
    by_parity,
    common_divisor,
    derivative,
    positive_roots,
    product,
    whole,
)
from nearharmonic.exact.words import StepPolynomials, oscillator
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import First, OneStepMethod, Tableau
from nearharmonic.numerics.written import is_real
from nearharmonic.theory.order_conditions import step_of

#: Components of the new state that can be decomposed.
Variable = Literal["position", "momentum"]

#: Decimal digits with which the closed forms are evaluated: more than any comparison with an error needs.
CLOSED_FORM_DIGITS = 50

#: Maximum number of error terms: all terms beyond lambda_max are 1, and lambda_max is at most 31 for registered
#: methods.
MOST_TERMS = 1000


def kappa(
    integrator: str | Tableau, highest: int, *, first: First | None = None, variable: Variable = "position"
) -> list[BigFloat]:
    """Return the error terms [kappa_1, ..., kappa_highest] of one step on the harmonic oscillator.

    They are defined by Nielsen (2015, Eq. 17): ``kappa_l = |x^(l)(0) - l! zeta_l|``, where zeta_l is the coefficient of
    tau^l in the new position and x(t) is the exact position, both for q_a = -p_a = 1. The momentum, which the paper
    does not treat, is decomposed in the same way. The values are exact for the printed coefficients and then rounded to
    ten digits more than these have: a term that vanishes for the true coefficients shows the rounding error of the
    printed digits.

    Parameters
    ----------
    integrator : str or Tableau
        OneStepMethod, or its name.
    highest : int
        Number of terms; beyond the highest power of tau in the step kappa_l = 1.
    first : {"drift", "kick"}, optional
        Operator to which the outer row is given; None leaves it as declared.
    variable : {"position", "momentum"}
        Component of the new state that is decomposed.

    Returns
    -------
    list of mpf
        ``highest`` terms, beginning with kappa_1.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``highest`` is no integer from 1 to 1000, ``first`` no operator, or ``variable`` neither "position" nor
        "momentum".

    Examples
    --------
    >>> import nearharmonic as nh
    >>> [f"{float(term):.3f}" for term in nh.kappa("leapfrog", 4)]
    ['0.000', '0.000', '1.000', '1.000']
    """
    number: Any = highest  # a user may pass anything
    if not (is_real(number) and isinstance(number, Integral) and 1 <= int(number) <= MOST_TERMS):
        raise bad_setting("highest", highest, f"an integer >= 1, and at most {MOST_TERMS}")
    tableau = tableau_of(integrator, first)
    terms = zeta(tableau, variable=variable)
    with mp.workdps(max(mp.dps, tableau.digits + 10)):
        return [as_mpf(abs(error)) for error in _errors(terms, int(highest), variable)]


def zeta(
    integrator: str | Tableau, *, first: First | None = None, variable: Variable = "position"
) -> tuple[Fraction, ...]:
    """Return the exact contributions (zeta_0, ..., zeta_lambda_max) to the new position or momentum (Nielsen 2015, Eq.
    7).

    They are for q_a = -p_a = 1 and m = k = 1. Arguments and errors are as for :func:`kappa`.
    """
    return _zeta(tableau_of(integrator, first), variable)


@lru_cache(maxsize=256)
def _zeta(tableau: Tableau, variable: Variable) -> tuple[Fraction, ...]:
    highest, K = lambda_max(tableau, variable=variable), _step_polynomials(tableau)
    from_q, from_p = (K.K11, K.K12) if variable == "position" else (K.K21, K.K22)
    return tuple(a - b for a, b in zip(from_q, from_p, strict=True))[: highest + 1]


def lambda_max(integrator: str | Tableau, *, first: First | None = None, variable: Variable = "position") -> int:
    """Return the highest power of tau in the new position: 2s if the kick is first (BAB), 2s + 1 if the drift is (ABA).

    For the new momentum the two are exchanged. If an outer coefficient is 0, as in asymmetric methods, the terms of the
    highest powers vanish. Steps with modified potentials and processors have higher powers; the result is then the
    highest nonzero power.
    """
    if variable not in {"position", "momentum"}:
        raise bad_setting("variable", variable, "it is 'position' or 'momentum'")
    tableau = tableau_of(integrator, first)
    if tableau.modified:
        K = _step_polynomials(tableau)
        rows = (K.K11, K.K12) if variable == "position" else (K.K21, K.K22)
        return max(n for row in rows for n, coefficient in enumerate(row) if coefficient)
    moved_last = "position" if tableau.first == "drift" else "momentum"
    return 2 * tableau.stages + (variable == moved_last)


def step_polynomials(integrator: str | Tableau, *, first: First | None = None) -> StepPolynomials:
    """Return the step matrix of the harmonic oscillator, exact.

    Arguments and errors are as for :func:`kappa`.
    """
    return _step_polynomials(tableau_of(integrator, first))


def stability_trace(integrator: str | Tableau, tau: BigFloat, *, first: First | None = None) -> BigFloat:
    """Return the trace of the step matrix: steps are stable if it lies in [-2, 2]; the exact flow has 2 cos(tau).

    ``tau`` is a finite step size above 0, in units with m = k = 1.
    """
    closed_form, step = _closed_form(tableau_of(integrator, first)), _step_size(tau)
    with mp.workdps(CLOSED_FORM_DIGITS):
        return _value(closed_form.trace, step)


def harmonic_energy_error(integrator: str | Tableau, tau: BigFloat, *, first: First | None = None) -> BigFloat:
    """Return the supremum of |H - H0|/H0 over arbitrarily many steps of size ``tau`` from (q, p) = (1, 0).

    It is inf if the trace is outside [-2, 2], where the error grows without bound.

    A step conserves -K21 q^2 + (K11 - K22) q p + K12 p^2. This is an ellipse whose squared half axes are -K21 over the
    eigenvalues of the form. For a symmetric step, K11 = K22, one squared half axis is 1, and the supremum is |-K21/K12
    - 1|.

    Arguments and errors are as for :func:`stability_trace`.
    """
    closed_form, step = _closed_form(tableau_of(integrator, first)), _step_size(tau)
    with mp.workdps(CLOSED_FORM_DIGITS):
        K12, defect = (_value(row, step) for row in (closed_form.K12, closed_form.defect))
        if abs(_value(closed_form.trace, step)) > 2 or K12 == 0:
            return inf
        if not closed_form.difference:
            return abs(defect / K12)
        # The eigenvalues are (K12 - K21 -+ gap)/2, here over tau, and K12 - K21 = 2 K12 - (K12 + K21).
        gap = mp.hypot(defect, step * _value(closed_form.difference, step))
        if 2 * K12 - defect <= gap:  # at the edge of stability the ellipse is a strip
            return inf
        return max(abs((defect + sign * gap) / (2 * K12 - defect + sign * gap)) for sign in (1, -1))


class _ClosedForm(NamedTuple):
    """Polynomials in tau^2, rounded once; common powers of tau of K12 and the defect cancel."""

    trace: tuple[BigFloat, ...]  # K11 + K22
    K12: tuple[BigFloat, ...]  # K12 / tau
    defect: tuple[BigFloat, ...]  # (K12 + K21) / tau, summed before rounding: it is as small as the energy error
    difference: tuple[BigFloat, ...]  # (K11 - K22) / tau^2, empty for a symmetric step


@lru_cache(maxsize=256)
def _closed_form(tableau: Tableau) -> _ClosedForm:
    K = _step_polynomials(tableau)
    rows = (K.trace[0::2], K.K12[1::2], K.defect[1::2], K.difference[2::2] if any(K.difference) else ())
    with mp.workdps(CLOSED_FORM_DIGITS):
        return _ClosedForm(*(tuple(map(as_mpf, row)) for row in rows))


@lru_cache(maxsize=256)
def _step_polynomials(tableau: Tableau) -> StepPolynomials:
    return oscillator(step_of(tableau))


@lru_cache(maxsize=2048)
def rotation_errors(tableau: Tableau, power: int) -> tuple[Fraction, ...]:
    """Return what K11, K12, K21 and K22 have more of a power of tau than the exact rotation."""
    none, term = Fraction(0), Fraction((1, 1, -1, -1)[power % 4], factorial(power))
    exact = (none, term, -term, none) if power % 2 else (term, none, none, term)
    rows = _step_polynomials(tableau)
    return tuple((row[power] if power < len(row) else none) - x for row, x in zip(rows, exact, strict=True))


def _errors(terms: Sequence[Fraction], highest: int, variable: Variable) -> Iterator[Fraction]:
    """Yield x^(l)(0) - l! zeta_l for l = 1 ... highest; q(t) = cos t - sin t, and p is its derivative."""
    ahead = 0 if variable == "position" else 1
    for power in range(1, highest + 1):
        derivative = (1, -1, -1, 1)[(power + ahead) % 4]
        yield derivative - factorial(power) * (terms[power] if power < len(terms) else Fraction(0))


def tableau_of(integrator: str | Tableau, first: First | None = None) -> Tableau:
    """Return the tableau, given or of this name, with its outer row assigned to the operator ``first``.

    Arguments and errors are as for :func:`kappa`.
    """
    found = method_of(integrator)
    if found.implicit:
        raise bad_setting("integrator", found.name, "a splitting method: an implicit one has no kicks and drifts")
    tableau: Tableau = found.role(first)
    return tableau


def method_of(integrator: str | OneStepMethod) -> Any:
    """Return the method, given or of this name."""
    return integrator if isinstance(integrator, OneStepMethod) else integrators[integrator]


def _step_size(tau: BigFloat) -> BigFloat:
    with mp.workdps(CLOSED_FORM_DIGITS):
        try:
            step = mpf(tau)
        except (TypeError, ValueError):
            step = inf
    if not (isfinite(step) and step > 0):
        raise bad_setting("tau", tau, "a finite number above 0")
    return step


def _value(coefficients: tuple[BigFloat, ...], tau: BigFloat) -> BigFloat:
    """Evaluate a polynomial in tau^2 by Horner's rule."""
    square, total = tau * tau, mpf(0)
    for coefficient in reversed(coefficients):
        total = total * square + coefficient
    return total


# --- Force gradients by differences: two opposite kicks around a short drift act as a kick of a modified potential.
#
# exp(a B) exp(d A) exp(b B) has the logarithm (a + b) B + d A + (d/2) (a - b) [B, A] + m C + ..., where C = [B, [A, B]]
# is the kick of the square of grad V and m = -d (a^2 - 4 a b + b^2) / 12. With kicks of opposite sign and a short
# backward drift the net kick is by V - (m / (a + b)) tau^2 |grad V|^2, like the middle kick of Chin (1997), but it
# needs no second derivative of V. Yin & Mawhinney (2011), arXiv:1111.5059, use a force at a shifted position for this
# purpose.

#: Longest drift, and smallest absolute value of a kick, in units of tau.
SHORT, LARGE = 0.03, 0.2


@dataclass(frozen=True)
class ShiftedKick:
    """Two kicks around a short drift: their positions in the step and their coefficients in units of tau.

    ``net`` is the sum of the kicks, ``square`` the coefficient m of C in units of tau^3.
    """

    place: int
    before: float
    drift: float
    behind: float

    @property
    def net(self) -> float:
        """Sum a + b of the kicks."""
        return self.before + self.behind

    @property
    def square(self) -> float:
        """Coefficient m of C."""
        return -self.drift * (self.before**2 - 4 * self.before * self.behind + self.behind**2) / 12


def shifted_kicks(tableau: Tableau) -> list[ShiftedKick]:
    """Return the pairs of large kicks of opposite sign around a short drift, in the order of a step."""
    step = [(letter, float(c)) for letter, c in step_of(tableau)]
    return [
        ShiftedKick(i // 2, a, d, b)
        for i, ((letter, a), (_, d), (_, b)) in enumerate(zip(step, step[1:], step[2:], strict=False))
        if letter == "B" and a * b < 0 and abs(d) < SHORT and min(abs(a), abs(b)) > LARGE
    ]


# --- Linear stability: step sizes with which the oscillator stays bounded, and growth rates beyond.
#
# A symmetric step has K11 = K22 and det K = 1, hence (tr K / 2)^2 - 1 = K12 K21: the trace is outside [-2, 2] where
# K12 K21 is positive. K12 K21 is a polynomial in x = tau^2 with rational coefficients. Its roots are isolated exactly
# (:mod:`nearharmonic.exact.polynomials`), so that arbitrarily narrow gaps are found. At a root of odd multiplicity a
# gap begins or ends; at a root of even multiplicity the trace touches 2.

#: Digits of the edges that are returned.
EDGE_DIGITS = 30

#: Reductions of the bracket in the search for the largest growth per time: to 1e-12 of its width.
_SECTIONS = 60


class Growth(NamedTuple):
    """The largest Lyapunov exponent in a gap: ``per_step`` at step size ``at``, ``per_time`` at ``at_time``; mpf."""

    per_step: BigFloat
    at: BigFloat
    per_time: BigFloat
    at_time: BigFloat


def stability_gaps(integrator: str | Tableau, *, first: First | None = None) -> list[tuple[BigFloat, BigFloat]]:
    """Return the intervals (start, end) of step sizes with |tr K| > 2, in ascending order, to 30 digits for m = k = 1.

    The last interval ends at infinity. Where the trace only touches 2 there is no interval. Arguments and errors are
    as for :func:`stability_limit`.
    """
    return gaps_of(step_polynomials(integrator, first=first))


def gaps_of(K: StepPolynomials) -> list[tuple[BigFloat, BigFloat]]:
    """Return the intervals of step sizes with |tr K| > 2 for a step matrix whose trace is 2 - tau^2 + ...

    The step need not be symmetric: without K11 = K22 the polynomial is (tr K)^2 - 4 itself.
    """
    crossing, _ = _special_squares(K)
    # The oscillator is stable for small steps and the trace is unbounded for large ones: the edges alternate.
    edges = [*_step_sizes(crossing), inf]
    return list(zip(edges[0::2], edges[1::2], strict=True))


def touching_points(integrator: str | Tableau, *, first: First | None = None) -> list[BigFloat]:
    """Return the step sizes, to 30 digits, at which |tr K| touches 2 without exceeding it, in ascending order.

    K is then +-1 times the identity, or has one more entry that is not 0. There is no exponential growth, but any
    perturbation of the step may open a gap.

    Arguments and errors are as for :func:`stability_gaps`.
    """
    _, touching = _special_squares(step_polynomials(integrator, first=first))
    return _step_sizes(touching)


def stability_limit(integrator: str | Tableau, *, first: First | None = None) -> BigFloat:
    """Return the step size, to 30 digits, at which the first gap begins; all smaller step sizes are stable.

    Where the trace of a method touches 2, printed coefficients open a gap by their rounding. A gap that is narrower,
    relative to its step size, than 100 units of the last digit counts as such a point.

    Parameters
    ----------
    integrator : str or Tableau
        Method, or its name.
    first : {"drift", "kick"}, optional
        Operator to which the outer row is given; None leaves it as declared.

    Returns
    -------
    mpf
        To 30 digits, in units with m = k = 1; infinite for a Gauss method, whose iteration ends earlier.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``first`` is no operator.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> print(f"{float(nh.stability_limit('leapfrog')):.3f}")
    2.000
    """
    if (method := method_of(integrator)).implicit:
        method.role(first)
        return inf
    return limit_of(stability_gaps(integrator, first=first), tableau_of(integrator).digits)


def limit_of(gaps: Sequence[tuple[BigFloat, BigFloat]], digits: int) -> BigFloat:
    """Return the step size at which the first gap begins that coefficients of so many digits, 0 if exact, resolve."""
    resolved = mpf(10) ** (2 - digits) if digits else mpf(0)
    return next(begin for begin, end in gaps if end - begin > resolved * begin)


def growth_rate(integrator: str | Tableau, tau: BigFloat, *, first: First | None = None) -> BigFloat:
    """Return the larger Lyapunov exponent of a step: ln of the larger |eigenvalue| of K, arcosh(|tr K|/2), 0 if stable.

    ``tau`` is a step size above 0, in units with m = k = 1.
    """
    # The printed digits of BCSS 4 produce a gap of width 1e-20, in which the trace exceeds 2 by 1e-40.
    with mp.workdps(max(mp.dps, CLOSED_FORM_DIGITS)):
        half = abs(stability_trace(integrator, tau, first=first)) / 2
        return acosh(half) if half > 1 else mpf(0)


def largest_growth(integrator: str | Tableau, gap: tuple[BigFloat, BigFloat], *, first: First | None = None) -> Growth:
    """Return the largest growth inside a gap of :func:`stability_gaps`, per step and per unit of time, to about 12
    digits.

    The maximum per step is at a root of d tr/d tau, and all roots are found exactly; in the last gap it is inf, at inf.
    The maximum per unit of time is searched for numerically between the neighbours of this root.
    """
    tableau, (start, end) = tableau_of(integrator, first), gap
    with mp.workdps(EDGE_DIGITS):
        inside = [x for x in _extrema(tableau) if start < x < end]

        def per_time(tau: BigFloat) -> BigFloat:
            return growth_rate(tableau, tau) / tau

        if isinf(end):
            far = 2 * start
            while per_time(2 * far) > per_time(far):  # ln of a polynomial over tau: it decreases for large tau
                far *= 2
            at_time = _highest(per_time, start, 2 * far)
            return Growth(inf, inf, per_time(at_time), at_time)
        at = max(inside, key=lambda tau: growth_rate(tableau, tau))
        left = max([start, *(x for x in inside if x < at)])
        at_time = _highest(per_time, left, at)  # dividing by tau moves a maximum to smaller steps
        return Growth(growth_rate(tableau, at), at, per_time(at_time), at_time)


@lru_cache(maxsize=256)
def _special_squares(K: StepPolynomials) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """Return the x = tau^2 at which |tr K| - 2 changes its sign, and the x at which |tr K| touches 2."""
    if K.K11 == K.K22:
        a, b = whole(K.K12[1::2]), whole(K.K21[1::2])
    else:  # tr K - 2 = -x + ... divided by x, and tr K + 2
        trace = K.trace[0::2]
        a, b = whole(trace[1:]), whole([trace[0] + 2, *trace[1:]])
    # Factors without common roots are treated separately, in a fifth of the time.
    apart = len(common_divisor(a, b)) == 1
    parts = [by_parity(factor) for factor in ((a, b) if apart else (product(a, b),))]
    crossing, touching = (
        tuple(sorted(root for p in side for root in positive_roots(p))) for side in zip(*parts, strict=True)
    )
    return crossing, touching


@lru_cache(maxsize=256)
def _extrema(tableau: Tableau) -> list[BigFloat]:
    """Return the step sizes at which the trace is stationary, in ascending order."""
    trace = whole(step_polynomials(tableau).trace[0::2])
    return _step_sizes(tuple(positive_roots(derivative(trace))))


def _step_sizes(squares: tuple[Fraction, ...]) -> list[BigFloat]:
    with mp.workdps(EDGE_DIGITS):
        return [sqrt(as_mpf(x)) for x in squares]


def _highest(function: Callable[[BigFloat], BigFloat], low: BigFloat, high: BigFloat) -> BigFloat:
    """Return the position of the only maximum of ``function`` in [low, high], by golden section."""
    ratio = (sqrt(mpf(5)) - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(_SECTIONS):
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - ratio * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + ratio * (high - low)
            at_right = function(right)
    return (low + high) / 2
