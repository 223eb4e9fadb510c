"""Coefficients of a splitting integrator, stored as exact decimal strings and validated on construction."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from fractions import Fraction
from hashlib import sha256
from typing import Literal

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.errors import TableauError, bad_setting

#: The operator applied first in a step: a drift moves q by dT/dp (ABA), a kick moves p by -dV/dq (BAB).
First = Literal["drift", "kick"]
Row = tuple[str, ...]

#: What a tableau of Runge-Kutta-Nystrom type asks of a system: T = p.p / 2.
QUADRATIC_KINETIC_ENERGY = "quadratic kinetic energy"

_OTHER: dict[First, First] = {"drift": "kick", "kick": "drift"}
#: A coefficient. Exponents are bounded because coefficients are held as exact fractions: 1e999999999 would fill the
#: memory.
DECIMAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)


def palindrome(*half: str, centre: str | None = None) -> Row:
    """Return the row that reads ``half`` forwards, ``centre`` once if its length is odd, and ``half`` backwards."""
    return (*half, *(() if centre is None else (centre,)), *reversed(half))


class Composition:
    """Kicks and drifts in turns: the rows by their places in a step."""

    first: First
    kick: Row
    drift: Row

    @property
    def outer(self) -> Row:
        """The s + 1 coefficients of the operator that comes first and last."""
        return self.kick if self.first == "kick" else self.drift

    @property
    def inner(self) -> Row:
        """The s coefficients of the operator in between."""
        return self.drift if self.first == "kick" else self.kick

    @property
    def stages(self) -> int:
        """Force evaluations per step, s; for kick first, the one that closes a step opens the next."""
        return len(self.inner)


@dataclass(frozen=True, kw_only=True)
class Tableau(Composition):
    """The coefficients of one integrator for H = T(p) + V(q), as decimal strings.

    One step of size tau applies ``outer[0], inner[0], outer[1], ..., inner[s-1], outer[s]``, where ``outer`` (s + 1
    values) is the row of the operator named by ``first`` and ``inner`` (s values) the row of the other one. A method
    with as many kicks as drifts begins or ends with "0" in its outer row.

    Parameters
    ----------
    name, label : str
        Name in settings, and in figures and tables, where it is the same by default.
    order : int
        Order for any separable H (for T = p.p/2 only, if ``requires`` says so).
    first : {"drift", "kick"}
        Operator that comes first and last in a step.
    kick, drift : tuple of str
        Coefficients of the two operators in units of tau, s + 1 for the one named by ``first`` and s for the other.
    symmetric : bool, optional
        Whether both rows are palindromes, so that a step of -tau undoes a step of tau: found from the rows. Rows that
        are no palindromes are refused, unless ``outer`` has "0" at one end alone, or False is given.
    source : str
        Where the coefficients come from.
    digits : int
        Number of decimals that the source guarantees.
    requires : str, optional
        What the method asks of a system: :data:`QUADRATIC_KINETIC_ENERGY`, or nothing.
    note : str
        A remark.
    benchmarked : bool
        Whether this is one of the ten methods of Nielsen's figures.
    harmonic_order : int, optional
        Order lambda_H to which the source claims to have solved for the harmonic oscillator (Nielsen 2015, Eq. 17), or
        None.
    generalised_order : tuple of int, optional
        Orders (r1, r2, ...) in tau that the source claims for the errors of size epsilon tau^r1, epsilon^2 tau^r2, ...
        for H = H_A + epsilon H_B (Blanes et al. 2013), or None.

    Raises
    ------
    TableauError
        A coefficient that is no decimal number, a row of the wrong length, one that is no palindrome, unless the method
        is not symmetric, or one whose sum differs from 1 by more than one unit of the last guaranteed decimal per
        coefficient.
    """

    name: str
    label: str = ""
    order: int
    first: First
    kick: Row
    drift: Row
    source: str
    digits: int
    requires: str | None = None
    note: str = ""
    benchmarked: bool = False
    harmonic_order: int | None = None
    generalised_order: tuple[int, ...] | None = None
    symmetric: bool = None  # type: ignore[assignment]  # None is for the constructor alone

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name)
        self._expect(self.first in _OTHER, "first", self.first, "'drift' or 'kick'")
        for key, number in (("order", self.order), ("digits", self.digits)):
            positive = isinstance(number, int) and not isinstance(number, bool) and number >= 1
            self._expect(positive, key, number, "an integer >= 1")
        known = self.requires in (None, QUADRATIC_KINETIC_ENERGY)
        self._expect(known, "requires", self.requires, f"None or {QUADRATIC_KINETIC_ENERGY!r}")
        for key in ("kick", "drift"):
            self._check_numbers(key)
        lengths = f"{len(self.kick)} kicks, {len(self.drift)} drifts"
        fits = len(self.outer) == len(self.inner) + 1 >= 2
        self._expect(fits, "rows", lengths, f"one {self.first} more than the other operator, as first = {self.first!r}")
        self._check_symmetry()
        for key in ("kick", "drift"):
            self._check_sum(key)

    @property
    def modified(self) -> bool:
        """True if kicks are of a modified potential: see :mod:`nearharmonic.integrators.modified`."""
        return False

    @property
    def processed(self) -> bool:
        """True if a processor is applied at output: see :mod:`nearharmonic.integrators.processed_tableau`."""
        return False

    @property
    def facts(self) -> dict[str, object]:
        """Facts of the tableau that a notebook shows, by name."""
        return {
            "name": self.name,
            "label": self.label,
            "stages": self.stages,
            "order": self.order,
            "first": self.first,
            "symmetric": "" if self.symmetric else "no",
            "requires": self.requires or "",
            "source": self.source,
        }

    def __repr__(self) -> str:
        from nearharmonic.registry.display import line

        return line("Tableau", self.facts)

    def _repr_html_(self) -> str:
        from nearharmonic.registry.display import facts_table

        rows = {
            f"{name} coefficients": ", ".join(f"{float(c)!r}" for c in getattr(self, name))
            for name in ("drift", "kick")
        }
        return facts_table("Tableau", {**self.facts, **rows})

    def _check_numbers(self, key: str) -> None:
        row = getattr(self, key)
        self._expect(isinstance(row, tuple), key, row, "a tuple of decimal strings")
        for i, text in enumerate(row):
            decimal = isinstance(text, str) and DECIMAL.fullmatch(text) is not None
            self._expect(decimal, f"{key}[{i}]", text, "a finite decimal number as a string")

    def _check_symmetry(self) -> None:
        """Find out whether the method is symmetric, and refuse rows that contradict what is said of it.

        A coefficient that is not its mirror image is most often a wrong digit, so that rows have to show that they are
        meant: by a "0" at one end, which no palindrome has.
        """
        self._expect(self.symmetric in (None, True, False), "symmetric", self.symmetric, "True, False or None")
        off = [
            (f"{key}[{i}]", text, mirror)
            for key in ("kick", "drift")
            for i, (text, mirror) in enumerate(zip(getattr(self, key), reversed(getattr(self, key)), strict=True))
            if text != mirror and Fraction(text) != Fraction(mirror)
        ]
        padded = (Fraction(self.outer[0]) == 0) != (Fraction(self.outer[-1]) == 0)
        if off and (self.symmetric or (self.symmetric is None and not padded)):
            place, text, mirror = off[0]
            self._expect(False, place, text, f"its mirror image {mirror!r}, or symmetric = False")
        object.__setattr__(self, "symmetric", not off)

    def _check_sum(self, key: str) -> None:
        row = getattr(self, key)
        # Exact: the digits of all numbers are within this precision, as their exponents have three digits at most.
        with localcontext(prec=2 * (1001 + max(map(len, row)))):
            excess = sum(map(Decimal, row), start=Decimal(-1))
        balanced = abs(Fraction(excess)) * 10**self.digits <= len(row)
        self._expect(balanced, f"{key} row sum", f"1{float(excess):+.1e}", f"1 within {len(row)}e-{self.digits}")

    def _expect(self, condition: bool, key: str, value: object, expected: str) -> None:
        if not condition:
            message = f"tableau {self.name!r}: {key} = {value!r}, expected {expected}"
            raise TableauError(message)

    @property
    def first_same_as_last(self) -> bool:
        """True if the force of a step's last kick is that of the next step's first kick."""
        return self.first == "kick"

    def role(self, first: First | None) -> Tableau:
        """Return the tableau whose outer row is given to the operator ``first``.

        A tableau with swapped roles keeps its order for separable H, but not what the source claims beyond it; one that
        requires a quadratic kinetic energy keeps order 2 for certain, for any separable H, or order 1 if it is not
        symmetric.

        Parameters
        ----------
        first : {"drift", "kick"} or None
            Operator of the outer row; None leaves the roles as declared.

        Raises
        ------
        SettingError
            ``first`` is neither "drift", "kick" nor None.
        """
        if first is None or first == self.first:
            return self
        if first not in _OTHER:
            key = "first"
            raise bad_setting(key, first, "it is 'drift' or 'kick'")
        # A Nystrom method loses its order; what any composition keeps is order 1, and a symmetric one order 2.
        order = self.order if self.requires is None else 1 + self.symmetric
        return replace(
            self, first=first, kick=self.drift, drift=self.kick, order=order, requires=None, harmonic_order=None,
            generalised_order=None,
        )  # fmt: skip

    def rows_exact(self) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
        """Return the outer and the inner row as the exact rational numbers that the strings denote."""
        return tuple(map(Fraction, self.outer)), tuple(map(Fraction, self.inner))

    def rows_double(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the outer and the inner row, each coefficient rounded once to the nearest double."""
        return tuple(map(float, self.outer)), tuple(map(float, self.inner))

    def rows_double_double(self) -> tuple[tuple[tuple[float, float], ...], tuple[tuple[float, float], ...]]:
        """Return the outer and the inner row as pairs (nearest double, nearest double to the rest), about 32 digits."""
        outer, inner = (tuple(rounded_pair(*c.as_integer_ratio()) for c in row) for row in self.rows_exact())
        return outer, inner

    def digest(self) -> str:
        """Return the SHA-256, in hex, of what determines the numbers of a run: the first operator and both rows."""
        text = "\n".join((self.first, " ".join(self.outer), " ".join(self.inner)))
        return sha256(text.encode()).hexdigest()
