"""Compositions of alternating kicks and drifts, as exact decimal strings: common base of steps and processors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from nearharmonic.errors import TableauError, shown

if TYPE_CHECKING:
    from numpy import int64
    from numpy.typing import NDArray

#: Number of steps of one run, or of many runs.
Steps = TypeVar("Steps", int, "NDArray[int64]")
#: The operator applied first in a step: a drift moves q by dT/dp (ABA), a kick moves p by -dV/dq (BAB).
First = Literal["drift", "kick"]
Row = tuple[str, ...]
#: A move of a run: kick (with the sign of the force), drift, and coefficient of grad |grad V|^2.
Move = tuple[Fraction, Fraction, Fraction]

#: A coefficient. Exponents are bounded because coefficients are exact fractions: 1e999999999 would fill the memory.
DECIMAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
#: Characters of a coefficient, and decimals that a source guarantees.
LONGEST, MOST_DIGITS = 1000, 1000


def is_count(value: object, most: int) -> bool:
    """Return True if ``value`` is an integer from 1 to ``most``."""
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= most


def written(coefficient: Any) -> Any:
    """Return a coefficient as a decimal: a float as it prints. Other objects are returned as they are."""
    if isinstance(coefficient, str | bool) or not isinstance(coefficient, int | float):
        return coefficient
    return repr(float(coefficient)) if isinstance(coefficient, float) else str(coefficient)


def palindrome(*half: str | float, centre: str | float | None = None) -> Row:
    """Return the palindrome of ``half``, ``centre`` if the length is odd, and ``half`` in reverse order.

    Parameters
    ----------
    *half : str or float
        First half of a row of coefficients: decimal strings; a float means the decimal that it prints as.
    centre : str or float, optional
        Coefficient in the middle, if the row has an odd length.

    Returns
    -------
    tuple of str
        The row.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> nh.palindrome("0.1", "0.2", centre="0.4")
    ('0.1', '0.2', '0.4', '0.2', '0.1')
    """
    row = tuple(map(written, half))
    return (*row, *(() if centre is None else (written(centre),)), *reversed(row))


class OneStepMethod:
    """A step that a kernel makes: a :class:`Composition` of kicks and drifts, or a collocation method.

    What differs between the two is overridden: the moves of a kernel, its settings, and the evaluations of the force.
    """

    name: str
    stages: int

    @property
    def other_names(self) -> tuple[str, ...]:
        """Label and aliases, which a look-up takes in place of the name."""
        return (vars(self)["label"], *vars(self)["aliases"])

    @property
    def moves_per_step(self) -> int:
        """Moves of a kernel in a step, apart from the one that opens or closes it."""
        return self.stages

    def steps(self, tau_per_stage: Fraction | float, t_end: Fraction | str | float, cost: float | None = None) -> int:
        """Return the steps in an interval, at least one, for a step size over the ``cost`` of a step, or its stages.

        It is max(1, round(t_end / tau)) with tau = ``tau_per_stage`` times the cost. The product is that of doubles if
        both factors are doubles. The division is exact unless ``t_end`` is a double; a decimal string is exact.
        """
        tau = tau_per_stage * (self.stages if cost is None else cost)
        return max(1, round(Fraction(t_end) / Fraction(tau) if isinstance(t_end, str | Fraction) else t_end / tau))

    def _expect(self, condition: bool, key: str, value: object, expected: str) -> None:
        if not condition:
            raise TableauError(f"{self._kind}: {key} = {shown(value)}, expected {expected}")

    @property
    def _kind(self) -> str:
        raise NotImplementedError


class Composition(OneStepMethod):
    """Alternating kicks and drifts; each row has the order of its application.

    A kick of a step tau is p -= k tau grad V - m tau^3 grad |grad V|^2, where |grad V|^2 is the square of grad V with
    the inverse masses. It is the exact flow of the potential k tau V - m tau^3 |grad V|^2. The row ``square`` has the
    coefficients m, one for each kick; without this row all kicks are of V alone.
    """

    first: First
    kick: Row
    drift: Row
    square: Row
    digits: int
    implicit = False

    @property
    def outer(self) -> Row:
        """The s + 1 coefficients of the operator that comes first and last."""
        return self.kick if self.first == "kick" else self.drift

    @property
    def inner(self) -> Row:
        """The s coefficients of the operator in between."""
        return self.drift if self.first == "kick" else self.kick

    @property
    def stages(self) -> int:  # type: ignore[override]
        """Force evaluations per step, s; with the kick first, the last force of a step is the first of the next."""
        return len(self.inner)

    def evaluations(self, steps: Steps) -> Steps:
        """Return the force evaluations of a run: s per step, and one more at the start if the kick is first."""
        return steps * self.stages + self.first_same_as_last

    @property
    def first_same_as_last(self) -> bool:
        """True if the last kick of a step and the first kick of the next step share one force."""
        return self.first == "kick"

    @property
    def modified(self) -> bool:
        """True if the method has modified potentials."""
        return bool(self.square)

    @property
    def kernel_options(self) -> dict[str, Any]:
        """Settings that the compiled code depends on."""
        return {"modified": self.modified}

    @property
    def compositions(self) -> tuple[Composition, ...]:
        """Compositions that a run applies: only the step, unless there is a processor."""
        return (self,)

    def moves(self, tau: Fraction = Fraction(1), *, rounded: bool = False) -> list[Move]:
        """Return the s + 2 moves of a run, multiplied exactly by powers of a step size.

        The first is the first move of a run. The second is the first move of each later step, merged with the last move
        of the step before. Then come the other moves, and the last move of a step. A run that begins with a drift has
        no first kick. If ``rounded``, products of coefficients and powers of tau are rounded to doubles before
        additions.
        """
        rows = (self.kick, -tau), (self.drift, tau), (self.square or ("0",) * len(self.kick), tau**3)
        found = ([Fraction(c) * factor if factor != 1 else Fraction(c) for c in row] for row, factor in rows)
        kicks, drifts, squares = ([Fraction(float(c)) for c in row] if rounded else row for row in found)
        nothing = Fraction(0)
        if self.first == "kick":
            opening, *between = zip(kicks, drifts, squares, strict=False)
            closing = kicks[-1], nothing, squares[-1]
            return [opening, (kicks[-1] + kicks[0], drifts[0], squares[-1] + squares[0]), *between, closing]
        *between, closing = zip(kicks, drifts[1:], squares, strict=True)
        merged = kicks[-1], drifts[-1] + drifts[0], squares[-1]
        return [(nothing, drifts[0], nothing), merged, *between, closing]

    def _check_rows(self) -> None:
        """Write floats as the decimals that they print as; raise an error for other objects, or for wrong lengths."""
        for key in ("kick", "drift", "square"):
            row = getattr(self, key)
            self._expect(isinstance(row, tuple | list), key, row, "a tuple of decimals")
            row = tuple(map(written, row))
            object.__setattr__(self, key, row)
            for i, text in enumerate(row):
                decimal = isinstance(text, str) and len(text) <= LONGEST and DECIMAL.fullmatch(text) is not None
                allowed = f"a finite decimal number of at most {LONGEST} characters"
                self._expect(decimal, f"{key}[{i}]", text, allowed)
        lengths = f"{len(self.kick)} kicks, {len(self.drift)} drifts"
        fits = len(self.outer) == len(self.inner) + 1 >= 2
        self._expect(fits, "rows", lengths, f"one {self.first} more than the other operator, as first = {self.first!r}")
        fits = len(self.square) in (0, len(self.kick))
        self._expect(fits, "square", f"{len(self.square)} numbers", f"one for each of {len(self.kick)} kicks")

    def _check_digits(self) -> None:
        self._expect(is_count(self.digits, MOST_DIGITS), "digits", self.digits, f"an integer from 1 to {MOST_DIGITS}")

    def _check_sums(self, total: int) -> None:
        for key, row in (("kick", self.kick), ("drift", self.drift)):
            # Exact: this precision holds all digits of the numbers, because exponents have at most three digits.
            with localcontext(prec=2 * (1001 + max(map(len, row)))):
                excess = sum(map(Decimal, row), start=Decimal(-total))
            balanced = abs(Fraction(excess)) * 10**self.digits <= len(row)
            shown = f"{total}{float(excess):+.1e}"
            self._expect(balanced, f"{key} row sum", shown, f"{total} within {len(row)}e-{self.digits}")


@dataclass(frozen=True, kw_only=True)
class Processor(Composition):
    """A step close to the identity: the kicks sum to 0, and so do the drifts.

    ``kick`` and ``drift`` are in units of tau, s + 1 for the operator named by ``first`` and s for the other, and
    ``square`` has the coefficients of grad |grad V|^2 in units of tau^3, one for each kick. Their first ``digits``
    decimals are guaranteed.
    """

    first: First
    kick: Row
    drift: Row
    square: Row
    digits: int

    def __post_init__(self) -> None:
        self._check_digits()
        self._check_rows()
        self._check_sums(0)

    @cached_property
    def inverse(self) -> Processor:
        """The inverse processor."""
        rows = ([_negated(text) for text in reversed(row)] for row in (self.kick, self.drift, self.square))
        kick, drift, square = map(tuple, rows)
        return Processor(first=self.first, kick=kick, drift=drift, square=square, digits=self.digits)

    @property
    def _kind(self) -> str:
        return "processor"


def _negated(text: str) -> str:
    return text[1:] if text.startswith("-") else f"-{text.removeprefix('+')}"
