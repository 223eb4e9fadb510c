"""Orders of a step on the harmonic oscillator H = (p^2 + q^2)/2, proved to the digits of its coefficients.

The step matrix is exact. The error of its coefficient of tau^n is bounded as for the order conditions
(:mod:`nearharmonic.exchange.proof.residuals`), with M^n / n! as the bound of the sum of absolute values of all terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from math import factorial

from nearharmonic.exact.decimals import BigFloat
from nearharmonic.exact.step import MOMENTUM, POSITION, Step, StepPolynomials, oscillator, oscillator_errors, slopes
from nearharmonic.exchange.composition import is_palindrome, size_of, symmetrised, uncertainty_of
from nearharmonic.exchange.proof.residuals import ROUNDING, Residual, linear_allowance
from nearharmonic.integrators.theory.linear_stability import gaps_of, limit_of

#: Linear combination of the four entries (K11, K12, K21, K22) of the step matrix.
_Weights = tuple[int, int, int, int]
_POSITION: tuple[_Weights, ...] = ((1, 0, 0, 0), (0, 1, 0, 0))
_MOMENTUM: tuple[_Weights, ...] = ((0, 0, 1, 0), (0, 0, 0, 1))
# The conserved quadratic form K12 p^2 - K21 q^2 + (K11 - K22) q p is a circle if both of these vanish.
_ENERGY: tuple[_Weights, ...] = ((0, 1, 1, 0), (1, 0, 0, -1))
_PHASE: tuple[_Weights, ...] = ((1, 0, 0, 1),)


class OscillatorStep:
    """A step of drifts and kicks on the harmonic oscillator.

    Its coefficients are of the type :class:`nearharmonic.exchange.composition.Printed`.
    """

    def __init__(self, step: Step) -> None:
        self.step = step

    @cached_property
    def position(self) -> Residual:
        """The first power of tau with an error in the new position; the harmonic order is one lower."""
        return self._first_failing(_POSITION)

    @property
    def harmonic_order(self) -> int:
        """Harmonic order lambda_H: the new position is exact up to this power of tau (Nielsen 2015, Eq. 17)."""
        return self.position.degree - 1

    @cached_property
    def momentum_order(self) -> int:
        """The power of tau up to which the new momentum is exact."""
        return self._first_failing(_MOMENTUM).degree - 1

    @cached_property
    def energy_order(self) -> int:
        """Order of the error of the energy over arbitrarily many steps."""
        return self._first_failing(_ENERGY).degree - 1

    @cached_property
    def phase_order(self) -> int:
        """Order of the error of the phase."""
        return self._first_failing(_PHASE).degree - 2

    @property
    def order(self) -> int:
        """Order on the oscillator: the smaller of the orders of position and momentum."""
        return min(self.harmonic_order, self.momentum_order)

    def stability_limit(self, digits: int) -> BigFloat:
        """Return the stability limit, an mpf, for coefficients of so many digits, 0 if exact: smaller steps are stable.

        The step must be consistent. A step that is a palindrome to its digits is treated as an exact palindrome, so
        that rounding errors of the digits do not open a gap where the trace touches 2.
        """
        step = symmetrised(self.step) if is_palindrome(self.step) else self.step
        return limit_of(gaps_of(oscillator(step)), digits)

    def _first_failing(self, combinations: Sequence[_Weights]) -> Residual:
        # At one power beyond the last power of the step, only the exact flow has a term.
        for power in range(1, len(self.step) + 3):
            found = [self._residual(weights, power) for weights in combinations]
            failing = [one for one in found if not one.vanishes]
            if failing:
                return max(failing, key=lambda one: abs(one.value))
        raise AssertionError("a polynomial cannot be the cosine")

    def _residual(self, weights: _Weights, power: int) -> Residual:
        value = sum((w * row[power] for w, row in zip(weights, self._errors, strict=True)), Fraction(0))
        return Residual(power, value, self._allowed(weights, power) if power <= len(self.step) else Fraction(0))

    def _allowed(self, weights: _Weights, power: int) -> Fraction:
        total = uncertainty_of(self.step)
        if total == 0:
            return total
        size = size_of(self.step)
        slack = ROUNDING * total * size ** (power - 1) / factorial(power - 1)
        if power > 1:
            slack += 2 * total**2 * (size + 2 * total) ** (power - 2) / factorial(power - 2)
        # From (1, -1), even powers of q and odd powers of p come from the first component, the others from the second.
        K11, K12, K21, K22 = weights
        of_q, of_p = (K11, -K22) if power % 2 == 0 else (-K12, K21)
        q, p = self._slopes
        return (
            linear_allowance(self.step, [of_q * a[power] + of_p * b[power] for a, b in zip(q, p, strict=True)]) + slack
        )

    @cached_property
    def _errors(self) -> StepPolynomials:
        return oscillator_errors(self.step)

    @cached_property
    def _slopes(self) -> tuple[list[list[float]], list[list[float]]]:
        """Return derivatives (flow, power) of the new position and momentum from (1, -1), in double precision."""
        step = [(letter, float(c)) for letter, c in self.step]
        return slopes(step, len(step), POSITION), slopes(step, len(step), MOMENTUM)
