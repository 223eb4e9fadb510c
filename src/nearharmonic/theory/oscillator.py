"""Exact decomposition of one step on the harmonic oscillator H = (p^2 + q^2)/2 by powers of the step size.

The step is a linear map (q, p) -> K (q, p) whose entries are polynomials in tau: a drift by c is the shear q += c tau
p, a kick by d the shear p -= d tau q. Every coefficient of a tableau is a decimal number, so the polynomials are
rational and have no rounding errors. mpmath only evaluates them at a step size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import factorial
from numbers import Integral
from typing import Any, Literal, NamedTuple

from mpmath import inf, isfinite, mp, mpf

from nearharmonic.errors import bad_setting
from nearharmonic.exact.decimals import BigFloat, as_mpf, decimals_in_common
from nearharmonic.exact.step import StepPolynomials, oscillator
from nearharmonic.integrators import integrators
from nearharmonic.integrators.composition import OneStepMethod
from nearharmonic.integrators.nielsen_2015 import TABLEAUS
from nearharmonic.integrators.tableau import First, Tableau
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

    They are for q_a = -p_a = 1 and m = k = 1. Arguments and errors are those of :func:`kappa`.
    """
    tableau = tableau_of(integrator, first)
    highest = lambda_max(tableau, variable=variable)
    K = _step_polynomials(tableau)
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

    Arguments and errors are those of :func:`kappa`.
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

    Arguments and errors are those of :func:`stability_trace`.
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


def _errors(terms: Sequence[Fraction], highest: int, variable: Variable) -> Iterator[Fraction]:
    """Yield x^(l)(0) - l! zeta_l for l = 1 ... highest; q(t) = cos t - sin t, and p is its derivative."""
    ahead = 0 if variable == "position" else 1
    for power in range(1, highest + 1):
        derivative = (1, -1, -1, 1)[(power + ahead) % 4]
        yield derivative - factorial(power) * (terms[power] if power < len(terms) else Fraction(0))


def tableau_of(integrator: str | Tableau, first: First | None = None) -> Tableau:
    """Return the tableau, given or of this name, with its outer row assigned to the operator ``first``.

    Arguments and errors are those of :func:`kappa`.
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
# backward drift the net kick is that of V - (m / (a + b)) tau^2 |grad V|^2, like the middle kick of Chin (1997), but it
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


# --- Table 4 of the paper: the independent coefficients of each set, printed and derived.

#: The sets of Table 4 by name, in its order.
SETS: Mapping[str, Tableau] = {tableau.name: tableau for tableau in TABLEAUS}

Rows = list[tuple[str | int, ...]]


def independent(tableau: Tableau) -> Iterator[tuple[str, int, str]]:
    """Return (symbol, index from 1, value) of each coefficient in the table.

    The table has half of each row, without the value that follows from the sum. d is the outer and c the inner row for
    both compositions.
    """
    for symbol, row in (("d", tableau.outer), ("c", tableau.inner)):
        for i in range((len(row) + 1) // 2 - 1):
            yield symbol, i + 1, row[i]


def table_4(derived: Mapping[str, Tableau] | None = None) -> tuple[tuple[str, ...], Rows]:
    """Return the header and the rows of Table 4, with ``derived`` sets, by name, beside the printed ones.

    There is a row for each independent coefficient: set, coefficient and printed value, with ``derived`` also the
    derived value and the decimals that agree. A set without a derived counterpart is marked as not derived.
    """
    rows: Rows = []
    for name, printed in SETS.items():
        found = None if derived is None else derived.get(name)
        others = list(independent(found)) if found is not None else None
        for k, (symbol, i, value) in enumerate(independent(printed)):
            row: tuple[str | int, ...] = (printed.label, f"{symbol}({i})", value)
            if derived is not None:
                other = others[k][2] if others is not None else ""
                row += (other, decimals_in_common(value, other) if other else "not derived")
            rows.append(row)
    header: tuple[str, ...] = ("set", "coefficient", "printed")
    return (header if derived is None else (*header, "derived", "agreeing decimals")), rows
