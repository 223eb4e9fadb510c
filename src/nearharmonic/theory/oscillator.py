"""One step of an integrator on the harmonic oscillator H = (p^2 + q^2)/2, decomposed by powers of the step, exactly.

The step is a linear map (q, p) -> K (q, p) whose entries are polynomials in tau: a drift by c is the shear
q += c tau p, a kick by d the shear p -= d tau q. Every coefficient of a tableau is a decimal number, so the polynomials
are rational and known without rounding; mpmath enters where a number is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from math import factorial
from numbers import Integral
from typing import Literal, NamedTuple

from mpmath import inf, isfinite, mp, mpf

from nearharmonic.errors import bad_setting
from nearharmonic.exact.decimals import BigFloat, as_mpf
from nearharmonic.exact.step import StepPolynomials, oscillator
from nearharmonic.integrators import integrators
from nearharmonic.integrators.order_conditions import step_of
from nearharmonic.integrators.tableau import First, Tableau

#: What of the new state is decomposed.
Variable = Literal["position", "momentum"]

#: Decimal digits that the closed forms are evaluated with: more than any error they are compared with needs.
CLOSED_FORM_DIGITS = 50

#: Error terms at most: those beyond lambda_max are all 1, and no registered method has more than 31 before.
MOST_TERMS = 1000


def kappa(
    integrator: str | Tableau, highest: int, *, first: First | None = None, variable: Variable = "position"
) -> list[BigFloat]:
    """Return the error terms [kappa_1, ..., kappa_highest] of one step (Nielsen 2015, Eq. 17).

    kappa_l = |x^(l)(0) - l! zeta_l|, where zeta_l is the coefficient of tau^l in the new position (or momentum, which
    the paper leaves aside) and x(t) the exact one, both from q_a = -p_a = 1. The values are exact for the printed
    coefficients, then rounded to ten digits more than these have: one that vanishes for the true coefficients shows
    what the printed digits leave of it.

    Parameters
    ----------
    integrator : str or Tableau
        Method, or its name.
    highest : int
        Number of terms; past :func:`lambda_max` no term of the step is left and kappa_l = 1.
    first : {"drift", "kick"}, optional
        Operator to which the outer row is given; None leaves it as declared.
    variable : {"position", "momentum"}
        What of the new state is decomposed.

    Returns
    -------
    list of mpf
        ``highest`` terms, kappa_1 first.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``highest`` is no integer from 1 to :data:`MOST_TERMS`, ``first`` no operator, or
        ``variable`` none of the two.
    """
    if isinstance(highest, bool) or not isinstance(highest, Integral) or not 1 <= highest <= MOST_TERMS:
        key = "highest"
        raise bad_setting(key, highest, f"an integer >= 1, and at most {MOST_TERMS}")
    tableau = tableau_of(integrator, first)
    terms = zeta(tableau, variable=variable)
    with mp.workdps(max(mp.dps, tableau.digits + 10)):
        return [as_mpf(abs(error)) for error in _errors(terms, int(highest), variable)]


def zeta(
    integrator: str | Tableau, *, first: First | None = None, variable: Variable = "position"
) -> tuple[Fraction, ...]:
    """Return what each order contributes to the new position or momentum (Nielsen 2015, Eq. 7).

    Parameters
    ----------
    integrator, first, variable
        As for :func:`kappa`, as are the errors.

    Returns
    -------
    tuple of Fraction
        (zeta_0, ..., zeta_lambda_max), exact, from q_a = -p_a = 1 and m = k = 1.
    """
    tableau = tableau_of(integrator, first)
    highest = lambda_max(tableau, variable=variable)
    K = _step_polynomials(tableau)
    from_q, from_p = (K.K11, K.K12) if variable == "position" else (K.K21, K.K22)
    return tuple(a - b for a, b in zip(from_q, from_p, strict=True))[: highest + 1]


def lambda_max(integrator: str | Tableau, *, first: First | None = None, variable: Variable = "position") -> int:
    """Return the highest power of tau in the new position: 2s if the kick is first (BAB), 2s + 1 if the drift is (ABA).

    In the new momentum the two are exchanged. Where a coefficient is 0, as at one end of rows that are not symmetric,
    the terms of the highest powers vanish. Kicks of a modified potential reach further, as do processors: the power is
    then the last that does not vanish.

    Parameters
    ----------
    integrator, first, variable
        As for :func:`kappa`, as are the errors.
    """
    if variable not in {"position", "momentum"}:
        key = "variable"
        raise bad_setting(key, variable, "it is 'position' or 'momentum'")
    tableau = tableau_of(integrator, first)
    if tableau.modified:
        K = _step_polynomials(tableau)
        rows = (K.K11, K.K12) if variable == "position" else (K.K21, K.K22)
        return max(n for row in rows for n, coefficient in enumerate(row) if coefficient)
    moved_last = "position" if tableau.first == "drift" else "momentum"
    return 2 * tableau.stages + (variable == moved_last)


def step_polynomials(integrator: str | Tableau, *, first: First | None = None) -> StepPolynomials:
    """Return the step matrix of the harmonic oscillator, exact.

    Arguments and errors are those of :func:`kappa`.
    """
    return _step_polynomials(tableau_of(integrator, first))


def stability_trace(integrator: str | Tableau, tau: BigFloat, *, first: First | None = None) -> BigFloat:
    """Return the trace of the step matrix: steps are stable while it lies in [-2, 2], and 2 cos(tau) is exact.

    Parameters
    ----------
    integrator : str or Tableau
        Method, or its name.
    tau : mpf
        Step size, in units in which m = k = 1.
    first : {"drift", "kick"}, optional
        As for :func:`kappa`.

    Returns
    -------
    mpf
        The trace at ``tau``.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    SettingError
        ``tau`` is no finite number above 0, or ``first`` no operator.
    """
    closed_form, step = _closed_form(tableau_of(integrator, first)), _step_size(tau)
    with mp.workdps(CLOSED_FORM_DIGITS):
        return _value(closed_form.trace, step)


def harmonic_energy_error(integrator: str | Tableau, tau: BigFloat, *, first: First | None = None) -> BigFloat:
    """Return the supremum of |H - H0|/H0 over arbitrarily many steps of size ``tau`` from (q, p) = (1, 0).

    A step conserves -K21 q^2 + (K11 - K22) q p + K12 p^2, an ellipse whose squared half axes are -K21 over the
    eigenvalues of this form. Of a symmetric step, K11 = K22, one of them is 1, and the supremum |-K21/K12 - 1|.

    Parameters
    ----------
    integrator, tau, first
        As for :func:`stability_trace`, as are the errors.

    Returns
    -------
    mpf
        The supremum; inf where the trace leaves [-2, 2], for there the error grows without bound.
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
    """Polynomials in tau^2, rounded once; the powers of tau that K12 and the defect have in common cancel."""

    trace: tuple[BigFloat, ...]  # K11 + K22
    K12: tuple[BigFloat, ...]  # K12 / tau
    defect: tuple[BigFloat, ...]  # (K12 + K21) / tau, summed before rounding: it is tiny where the energy error is
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


def _errors(terms: Sequence[Fraction], highest: int, variable: Variable) -> Iterator[Fraction]:
    """x^(l)(0) - l! zeta_l for l = 1 ... highest; q(t) = cos t - sin t, and p is its derivative."""
    ahead = 0 if variable == "position" else 1
    for power in range(1, highest + 1):
        derivative = (1, -1, -1, 1)[(power + ahead) % 4]
        yield derivative - factorial(power) * (terms[power] if power < len(terms) else Fraction(0))


def tableau_of(integrator: str | Tableau, first: First | None = None) -> Tableau:
    """Return the tableau of this name, or the one given, with its outer row given to the operator ``first``.

    Arguments and errors are those of :func:`kappa`.
    """
    return (integrator if isinstance(integrator, Tableau) else integrators[integrator]).role(first)


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
    """A polynomial in tau^2, by Horner's rule."""
    square, total = tau * tau, mpf(0)
    for coefficient in reversed(coefficients):
        total = total * square + coefficient
    return total
