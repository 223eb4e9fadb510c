"""Orders of a step on the harmonic oscillator H = (p^2 + q^2)/2, proved within what its digits allow.

The step matrix is exact. How far a coefficient of tau^n in it can be off is bounded as for the order conditions
(:mod:`nearharmonic.exchange.proof.residuals`), with M^n / n! as the sum of all its terms with their absolute values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import TYPE_CHECKING

from nearharmonic.exchange.composition import Step, is_palindrome, operators_of, size_of, symmetrised
from nearharmonic.exchange.proof.residuals import ROUNDING, Residual, linear_allowance

if TYPE_CHECKING:
    import numpy as np

    from nearharmonic.exact.decimals import BigFloat
    from nearharmonic.theory.oscillator import StepPolynomials

#: A combination of the four entries (K11, K12, K21, K22) of the step matrix.
_Weights = tuple[int, int, int, int]
_POSITION: tuple[_Weights, ...] = ((1, 0, 0, 0), (0, 1, 0, 0))
_MOMENTUM: tuple[_Weights, ...] = ((0, 0, 1, 0), (0, 0, 0, 1))
# The conserved quadratic form K12 p^2 - K21 q^2 + (K11 - K22) q p is a circle if both of these vanish.
_ENERGY: tuple[_Weights, ...] = ((0, 1, 1, 0), (1, 0, 0, -1))
_PHASE: tuple[_Weights, ...] = ((1, 0, 0, 1),)


class OscillatorStep:
    """A step on the harmonic oscillator.

    Parameters
    ----------
    step : tuple of Substep
        The drifts and kicks.
    """

    def __init__(self, step: Step) -> None:
        self.step = step

    @cached_property
    def position(self) -> Residual:
        """The first failing power of tau in the new position; one below it is the harmonic order."""
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
        """Order on the oscillator: the smaller one of those of position and momentum."""
        return min(self.harmonic_order, self.momentum_order)

    def stability_limit(self) -> BigFloat:
        """Return the step size up to which every smaller one is stable, as an mpf.

        The step must be consistent. A step that is a palindrome to its digits only counts as one, so that the last
        digits open no gap where the trace touches 2.
        """
        from nearharmonic.theory.linear_stability import gaps_of

        step = symmetrised(self.step) if is_palindrome(self.step) else self.step
        return gaps_of(_polynomials(step))[0][0]

    def _first_failing(self, combinations: Sequence[_Weights]) -> Residual:
        # One power beyond the last of the step, the exact flow has a term and the step has none.
        for power in range(1, len(self.step) + 4):
            found = [self._residual(weights, power) for weights in combinations]
            failing = [one for one in found if not one.vanishes]
            if failing:
                return max(failing, key=lambda one: abs(one.value))
        raise AssertionError("a polynomial cannot be the cosine")

    def _residual(self, weights: _Weights, power: int) -> Residual:
        k, n, m = power % 4, factorial(power), len(self.step)
        cosine, sine = Fraction((1, 0, -1, 0)[k], n), Fraction((0, 1, 0, -1)[k], n)
        exact = (cosine, sine, -sine, cosine)
        entries = [row[power] if power <= m else Fraction(0) for row in self._entries]
        value = sum((w * (a - b) for w, a, b in zip(weights, entries, exact, strict=True)), Fraction(0))
        return Residual(power, value, self._allowed(weights, power) if power <= m else Fraction(0))

    def _allowed(self, weights: _Weights, power: int) -> Fraction:
        import numpy as np

        total = sum((one.uncertainty for one in self.step), Fraction(0))
        if total == 0:
            return total
        size = size_of(self.step)
        slack = ROUNDING * total * size ** (power - 1) / factorial(power - 1)
        if power > 1:
            slack += 2 * total**2 * (size + 2 * total) ** (power - 2) / factorial(power - 2)
        gradient = np.tensordot(np.array(weights, dtype=float), self._derivatives[:, :, power], axes=1)
        return linear_allowance(self.step, gradient) + slack

    @cached_property
    def _entries(self) -> StepPolynomials:
        return _polynomials(self.step)

    @cached_property
    def _derivatives(self) -> np.ndarray:
        """The derivatives of the coefficients of the entries, (entry, substep, power), in double precision."""
        import numpy as np

        shears = [_shear(one.letter, float(one.value)) for one in self.step]
        before = list(_running(shears, lambda done, shear: _composed(shear, done)))
        after = list(_running(reversed(shears), _composed))[::-1]
        width = len(self.step) + 1
        result = np.zeros((4, len(self.step), width))
        for i, one in enumerate(self.step):
            slope = _shear(one.letter, 1.0)
            slope[0, 0, 0] = slope[1, 1, 0] = 0
            product = _composed(after[i + 1], _composed(slope, before[i]))
            result[:, i, :] = product.reshape(4, -1)[:, :width]
        return result


def _polynomials(step: Step) -> StepPolynomials:
    from nearharmonic.theory.oscillator import polynomials_of

    return polynomials_of(operators_of(step))


def _running(
    matrices: Iterator[np.ndarray] | Sequence[np.ndarray], compose: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> Iterator[np.ndarray]:
    """The identity, and the products of the first one, two, ... ``matrices``."""
    done = _shear("A", 0.0)
    yield done
    for matrix in matrices:
        done = compose(done, matrix)
        yield done


def _shear(letter: str, c: float) -> np.ndarray:
    """The matrix of a drift or kick, (2, 2, 2), the last axis being the power of tau."""
    import numpy as np

    matrix = np.zeros((2, 2, 2))
    matrix[0, 0, 0] = matrix[1, 1, 0] = 1
    if letter == "A":
        matrix[0, 1, 1] = c
    else:
        matrix[1, 0, 1] = -c
    return matrix


def _composed(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The product of two matrices of polynomials in tau."""
    import numpy as np

    product = np.zeros((2, 2, left.shape[2] + right.shape[2] - 1))
    for i, j, k in np.ndindex(2, 2, 2):
        product[i, k] += np.convolve(left[i, j], right[j, k])
    return product
