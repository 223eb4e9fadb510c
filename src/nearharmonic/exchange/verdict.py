"""Proved properties of the coefficients of a file, and the claims that hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import NamedTuple

from nearharmonic.exact.polynomials import BigFloat
from nearharmonic.exact.words import MOMENTUM, POSITION, Step, StepPolynomials, oscillator, oscillator_errors, slopes
from nearharmonic.exchange import method
from nearharmonic.exchange import proof as proving
from nearharmonic.exchange.files import HIGHEST_ORDER, CoefficientFile
from nearharmonic.theory.oscillator import gaps_of, limit_of

# --- Orders of a step on the harmonic oscillator H = (p^2 + q^2)/2, proved to the digits of its coefficients.
#
# The step matrix is exact. The error of its coefficient of tau^n is bounded as for the order conditions
# (:mod:`nearharmonic.exchange.proof`), with M^n / n! as the bound of the sum of absolute values of all terms.

#: Linear combination of the four entries (K11, K12, K21, K22) of the step matrix.
_Weights = tuple[int, int, int, int]
_POSITION: tuple[_Weights, ...] = ((1, 0, 0, 0), (0, 1, 0, 0))
_MOMENTUM: tuple[_Weights, ...] = ((0, 0, 1, 0), (0, 0, 0, 1))
# The conserved quadratic form K12 p^2 - K21 q^2 + (K11 - K22) q p is a circle if both of these vanish.
_ENERGY: tuple[_Weights, ...] = ((0, 1, 1, 0), (1, 0, 0, -1))
_PHASE: tuple[_Weights, ...] = ((1, 0, 0, 1),)


class OscillatorStep:
    """A step of drifts and kicks on the harmonic oscillator.

    Its coefficients are of the type :class:`nearharmonic.exchange.method.Printed`.
    """

    def __init__(self, step: Step) -> None:
        self.step = step

    @cached_property
    def position(self) -> proving.Residual:
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
        step = method.symmetrised(self.step) if method.is_palindrome(self.step) else self.step
        return limit_of(gaps_of(oscillator(step)), digits)

    def _first_failing(self, combinations: Sequence[_Weights]) -> proving.Residual:
        # At one power beyond the last power of the step, only the exact flow has a term.
        for power in range(1, len(self.step) + 3):
            found = [self._residual(weights, power) for weights in combinations]
            failing = [one for one in found if not one.vanishes]
            if failing:
                return max(failing, key=lambda one: abs(one.value))
        raise AssertionError("a polynomial cannot be the cosine")

    def _residual(self, weights: _Weights, power: int) -> proving.Residual:
        value = sum((w * row[power] for w, row in zip(weights, self._errors, strict=True)), Fraction(0))
        return proving.Residual(power, value, self._allowed(weights, power) if power <= len(self.step) else Fraction(0))

    def _allowed(self, weights: _Weights, power: int) -> Fraction:
        total = method.uncertainty_of(self.step)
        if total == 0:
            return total
        size = method.size_of(self.step)
        slack = proving.ROUNDING * total * size ** (power - 1) / factorial(power - 1)
        if power > 1:
            slack += 2 * total**2 * (size + 2 * total) ** (power - 2) / factorial(power - 2)
        # From (1, -1), even powers of q and odd powers of p come from the first component, the others from the second.
        K11, K12, K21, K22 = weights
        of_q, of_p = (K11, -K22) if power % 2 == 0 else (-K12, K21)
        q, p = self._slopes
        return (
            proving.linear_allowance(self.step, [of_q * a[power] + of_p * b[power] for a, b in zip(q, p, strict=True)])
            + slack
        )

    @cached_property
    def _errors(self) -> StepPolynomials:
        return oscillator_errors(self.step)

    @cached_property
    def _slopes(self) -> tuple[list[list[float]], list[list[float]]]:
        """Return derivatives (flow, power) of the new position and momentum from (1, -1), in double precision."""
        step = [(letter, float(c)) for letter, c in self.step]
        return slopes(step, len(step), POSITION), slopes(step, len(step), MOMENTUM)


#: Minimum number of digits: with fewer digits a claim that holds is not significant.
FEWEST_DIGITS = 8


class Claim(NamedTuple):
    """A claim of a file, whether it holds, and the proof in one line."""

    says: str
    holds: bool
    proof: str


@dataclass(frozen=True)
class Verdict:
    """Proved properties of a file."""

    file: CoefficientFile

    @cached_property
    def digits(self) -> method.Digits:
        """The digits that the coefficients have."""
        return method.digits_of(self.file)

    @cached_property
    def digits_that_hold(self) -> int | None:
        """Largest number of digits to which all claims hold; None if these are all digits or too few."""
        fewer = range(self.digits.number - 1, FEWEST_DIGITS - 1, -1)
        if self.holds or not self._to_digits(FEWEST_DIGITS).holds:
            return None
        return next((n for n in fewer if self._to_digits(n).holds), None)

    def _to_digits(self, digits: int) -> Verdict:
        return Verdict(replace(self.file, digits=digits))

    @cached_property
    def step(self) -> Step:
        """The drifts and kicks of one step."""
        return method.step_of(self.file.kick, self.file.drift, self.file.first, self.digits.number)

    @cached_property
    def sums(self) -> dict[str, proving.Residual]:
        """The sums of the rows minus 1, by ``drift`` and ``kick``."""
        drift, kick = proving.residuals(self.step, 1, quadratic=False)
        return {"kick": kick, "drift": drift}

    @property
    def is_consistent(self) -> bool:
        """True if both sums are 1."""
        return all(one.vanishes for one in self.sums.values())

    @cached_property
    def is_symmetric(self) -> bool:
        """True if the step is a palindrome, to its digits."""
        return method.is_palindrome(self.step)

    @cached_property
    def order(self) -> proving.Order:
        """The order for every separable H."""
        return proving.proved_order(self.step, HIGHEST_ORDER, quadratic=False)

    @cached_property
    def quadratic_order(self) -> proving.Order:
        """The order for every H with T = p.p/2."""
        return proving.proved_order(self.step, HIGHEST_ORDER, quadratic=True)

    def polynomial_order(self, degree: int) -> proving.Order:
        """Return the order for every H with T = p.p/2 and a polynomial V of this degree."""
        return proving.proved_order(self.step, HIGHEST_ORDER, quadratic=True, potential_degree=degree)

    @cached_property
    def oscillator(self) -> OscillatorStep:
        """The step on the harmonic oscillator."""
        return OscillatorStep(self.step)

    @cached_property
    def stability_limit(self) -> BigFloat | None:
        """The step size up to which the oscillator is stable, None if the sums are not 1."""
        return self.oscillator.stability_limit(self.digits.number) if self.is_consistent else None

    @cached_property
    def nearest(self) -> proving.Likeness | None:
        """The registered method nearest to the coefficients."""
        return proving.nearest(self.step)

    @cached_property
    def claims(self) -> tuple[Claim, ...]:
        """The claims of the file, and the implied claim that the rows sum to 1."""
        return tuple(_claims(self))

    @property
    def holds(self) -> bool:
        """True if all claims hold."""
        return all(claim.holds for claim in self.claims)

    @cached_property
    def suspects(self) -> list[proving.Suspect]:
        """Single transcription errors that explain the claims that do not hold; none if all hold."""
        if self.holds:
            return []
        return proving.suspects(self.file, self.digits.number, self._proves, self._target)

    @property
    def _target(self) -> int:
        """The claimed order; without a claim, order 4, which chance rarely produces."""
        return self.file.order or min(max(4, self.quadratic_order.order + 2), HIGHEST_ORDER)

    def _proves(self, rows: proving.Rows) -> bool:
        """Return True if every claim holds for these rows, and they have the order :attr:`_target`."""
        step = method.step_of(rows.kick, rows.drift, rows.first, self.digits.number)
        symmetric = self.file.symmetric in (None, method.is_palindrome(step))
        quadratic = self.file.order is None or self.file.requires is not None
        reached = proving.proved_order(step, self._target, quadratic=quadratic).order == self._target
        return symmetric and reached and _role_claims_hold(self.file, step)

    @cached_property
    def warnings(self) -> list[str]:
        """Differences from the nearest registered method that no claim concerns."""
        return list(_warnings(self))


def _claims(found: Verdict) -> Iterator[Claim]:
    yield _sums(found)
    file = found.file
    if file.symmetric is not None:
        yield _symmetry(found, claimed=file.symmetric)
    if file.order is not None:
        yield _order(found, file.order)
    if file.harmonic_order is not None:
        yield _harmonic(found, file.harmonic_order)
    if file.harmonic_order is not None or (file.order is not None and file.requires is not None):
        yield from _role(found)


def _sums(found: Verdict) -> Claim:
    parts = (
        f"{key} 1{float(one.value):+.1e} ({_allowed(one, found.digits)})" if one.value else f"{key} exactly 1"
        for key, one in found.sums.items()
    )
    return Claim("rows sum to 1", found.is_consistent, "; ".join(parts))


def _symmetry(found: Verdict, *, claimed: bool) -> Claim:
    step = found.step
    pairs = [(a, b) for (x, a), (y, b) in zip(step, reversed(step), strict=True) if x == y]
    worst = max(pairs, key=lambda pair: abs(pair[0] - pair[1]), default=None)
    if worst is None:
        proof = "the step begins and ends with different operators"
    elif worst[0] == worst[1]:
        proof = "every coefficient is its mirror image"
    else:
        difference = f"{worst[0].place} and its mirror image {worst[1].place} differ by"
        proof = f"{difference} {abs(float(worst[0] - worst[1])):.1e} (to {found.digits.words})"
    return Claim(f"symmetric = {str(claimed).lower()}", claimed == found.is_symmetric, proof)


def _order(found: Verdict, claimed: int) -> Claim:
    quadratic = found.file.requires is not None
    proved = found.quadratic_order if quadratic else found.order
    kind = "for quadratic kinetic energy" if quadratic else "for every separable H"
    holds = proved.order >= claimed
    proof = order_proof(proved, found.digits)
    if not holds and not quadratic:
        proof += f"; for quadratic T it is {found.quadratic_order.order}, on the oscillator {found.oscillator.order}"
    return Claim(f"order = {claimed} {kind}", holds, proof)


def order_proof(proved: proving.Order, digits: method.Digits) -> str:
    """Return the proof of an order in one line."""
    parts = []
    if proved.order:
        largest = "exactly"
        if proved.largest.value:
            largest = f"(largest {float(proved.largest.value):.1e}; {_allowed(proved.largest, digits)})"
        parts.append(f"the conditions up to degree {proved.order} vanish {largest}")
    if proved.failing is not None:
        what = "one of degree" if proved.order else "a condition of degree"
        parts.append(_failure(proved.failing, what, digits))
    return f"order {proved.order}: {'; '.join(parts)}"


def _allowed(one: proving.Residual, digits: method.Digits) -> str:
    return f"{digits.words} allow {float(one.allowed):.1e}" if one.allowed else digits.words


def _failure(failing: proving.Residual, what: str, digits: method.Digits) -> str:
    return f"{what} {failing.degree} is off by {float(failing.value):.1e} ({_allowed(failing, digits)})"


def _harmonic(found: Verdict, claimed: int) -> Claim:
    one = found.oscillator
    failure = _failure(one.position, "the coefficient of tau to the power", found.digits)
    proof = f"harmonic order {one.harmonic_order} with the {found.file.first} first: in the new position, {failure}"
    return Claim(f"harmonic_order = {claimed}", one.harmonic_order >= claimed, proof)


def _role(found: Verdict) -> Iterator[Claim]:
    """Yield the claim of the first operator, if a claim depends on it: false if it holds only with exchanged roles."""
    file, first = found.file, found.file.first
    exchanged = method.with_roles_exchanged(found.step)
    own, other = (_role_claims_hold(file, step) for step in (found.step, exchanged))
    if not (own or other):
        return
    shown = ", ".join(
        f"{_orders_of_role(file, step)} with the {role} first"
        for step, role in ((found.step, first), (exchanged, "kick" if first == "drift" else "drift"))
    )
    yield Claim(f"first = {first}", own, shown)


def _role_claims_hold(file: CoefficientFile, step: Step) -> bool:
    """Return True if the claims that depend on the roles hold for ``step``."""
    if file.harmonic_order is not None and OscillatorStep(step).harmonic_order < file.harmonic_order:
        return False
    if file.order is None or file.requires is None:
        return True
    return proving.proved_order(step, file.order, quadratic=True).order >= file.order


def _orders_of_role(file: CoefficientFile, step: Step) -> str:
    parts = []
    if file.order is not None and file.requires is not None:
        parts.append(f"order {proving.proved_order(step, HIGHEST_ORDER, quadratic=True).order} for quadratic T")
    if file.harmonic_order is not None:
        parts.append(f"harmonic order {OscillatorStep(step).harmonic_order}")
    return " and ".join(parts)


def _warnings(found: Verdict) -> Iterator[str]:
    file = found.file
    if 0 < found.digits.number < FEWEST_DIGITS:
        yield f"{found.digits.words} are few: an order proved to so few digits may be wrong"
    exchanged = method.with_roles_exchanged(found.step)
    quadratic = proving.proved_order(exchanged, HIGHEST_ORDER, quadratic=True).order
    if quadratic > found.quadratic_order.order:
        own = f"{found.quadratic_order.order} with the {file.first} first"
        yield f"for quadratic T the order is {own}, and {quadratic} with the roles exchanged"
    like = found.nearest
    if like is None or not like.is_recognised:
        return
    name = f"{like.tableau.label} ({like.tableau.name})"
    if like.exchanged and not any(claim.says.startswith("first") and claim.holds for claim in found.claims):
        role = like.tableau.first
        yield f"the {found.file.first} is first here; the coefficients belong to {name}, where the {role} is first"
    if like.reversed:
        yield f"the step is a backward step of {name}"
    if like.rescaled:
        yield f"the rows are a multiple of the rows of {name}"
    for place, here, there in like.differing:
        difference = f"they differ by {float(abs(here - there)):.1e}"
        yield f"{place} = {float(here)!r}, but {float(there)!r} in {name}; {difference}"
