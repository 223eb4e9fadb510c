"""Linear stability: step sizes with which an integrator keeps the harmonic oscillator bounded, and growth rates beyond.

A symmetric step has K11 = K22 and det K = 1, hence (tr K / 2)^2 - 1 = K12 K21: the trace is outside [-2, 2] where K12
K21 is positive. K12 K21 is a polynomial in x = tau^2 with rational coefficients. Its roots are isolated exactly
(:mod:`nearharmonic.exact.polynomials`), so that arbitrarily narrow gaps are found. At a root of odd multiplicity a gap
begins or ends; at a root of even multiplicity the trace touches 2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from mpmath import acosh, inf, isinf, mp, mpf, sqrt

from nearharmonic.exact.decimals import BigFloat, as_mpf
from nearharmonic.exact.polynomials import by_parity, common_divisor, derivative, positive_roots, product, whole
from nearharmonic.exact.step import StepPolynomials
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.theory.oscillator import CLOSED_FORM_DIGITS, method_of, stability_trace, step_polynomials, tableau_of

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
    those of :func:`stability_limit`.
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

    Arguments and errors are those of :func:`stability_gaps`.
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
