"""Families of symmetric methods: their free coefficients, and the order conditions that these have to meet.

Unknowns are the first half of the outer row but for its innermost value, that of the inner row likewise, and the
squares of the kicks that have one: the two rows sum to 1 by the values left out. What is left of order four are two
equations; for quadratic T order six has four more, whatever the number of stages. An order lambda_H on the oscillator
has one for each power of tau from five on, kappa_l = 0 (Nielsen 2015, Eq. 17).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from mpmath import mp, mpf
from numpy.typing import NDArray

from nearharmonic.errors import bad_setting
from nearharmonic.exact.decimals import BigFloat, as_mpf
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.theory.word_sums import Factor, word_sums

Floats = NDArray[np.float64]
#: An equation: weights of words, and what the weighted sum has to be.
Equation = tuple[list[tuple[Fraction, str]], Fraction]

#: Newton steps that a projection takes at most, the largest change of an unknown in one, and the residual at the end.
PROJECTIONS, LONGEST, MET = 10, 0.3, 1e-10
#: Residual below which a projection goes on with the derivatives that it has.
NEAR = 1e-6
#: Imaginary step whose quotient is a derivative to all digits.
IMAGINARY = 1e-40
#: Harmonic orders that can be asked for.
HARMONIC_ORDERS = range(4, 9)


@dataclass(frozen=True, kw_only=True)
class Family:
    """Symmetric compositions of s stages that meet order conditions.

    Parameters
    ----------
    stages : int
        Stages s of a step.
    first : {"drift", "kick"}
        Operator of the outer row.
    order : {4, 6}
        Order for quadratic T. Without squares 4 is the order for any separable H, and 6 means 4 there.
    harmonic_order : int
        Order lambda_H on the harmonic oscillator, 4 to 8.
    squares : tuple of int
        Kicks, counted from the outermost, that are of a modified potential.

    Raises
    ------
    SettingError
        Another order, or too few unknowns for the equations.
    """

    stages: int
    first: First
    order: int = 4
    harmonic_order: int = 4
    squares: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for key, value, known in (
            ("order", self.order, (4, 6)),
            ("harmonic_order", self.harmonic_order, HARMONIC_ORDERS),
            ("first", self.first, ("drift", "kick")),
        ):
            if value not in known:
                raise bad_setting(key, value, f"one of {', '.join(map(str, known))}")
        if self.unknowns < len(self.equations):
            what = f"at least {len(self.equations)} free coefficients for as many equations, and there are"
            raise bad_setting("stages", self.stages, f"{what} {self.unknowns}")

    @property
    def halves(self) -> tuple[int, int]:
        """Unknowns of the outer and of the inner row."""
        return self.stages // 2, (self.stages - 1) // 2

    @property
    def unknowns(self) -> int:
        """Number n of unknowns: s - 1, and one for each square."""
        return self.stages - 1 + len(self.squares)

    @property
    def gradients(self) -> int:
        """Force evaluations of a step that take the gradient of the square of grad V as well."""
        kicks = self.stages + (self.first == "kick")
        count = sum(1 if 2 * i + 1 == kicks else 2 for i in self.squares)
        return count - (self.first == "kick" and 0 in self.squares)

    @cached_property
    def equations(self) -> tuple[Equation, ...]:
        """Each multiplied by n! for words of n letters, so that residuals are of one size."""
        found: list[Equation] = []
        for degree in range(3, self.order, 2):
            n, words = factorial(degree), lyndon_words(degree)
            for row in conditions(degree, quadratic=True):
                left = [(n * w, word) for w, word in zip(row.weights, words, strict=True) if w]
                found.append((left, sum(row.weights, Fraction(0))))
        powers = range(self.order + 1, self.harmonic_order + 1)
        return (*found, *(([(Fraction(factorial(n)), ("AB" * n)[:n])], Fraction(1)) for n in powers))

    def rows(self, x: Sequence[Any] | Floats) -> tuple[list[Any], list[Any], list[Any]]:
        """Return all kicks, drifts and squares of a step, in the arithmetic of the n unknowns ``x``."""
        outer, inner = self.halves
        first, second = _closed(x[:outer], self.stages + 1), _closed(x[outer : outer + inner], self.stages)
        kicks, drifts = (first, second) if self.first == "kick" else (second, first)
        squares: list[Any] = [0 * kick for kick in kicks]
        for place, value in zip(self.squares, x[outer + inner :], strict=True):
            squares[place] = squares[-1 - place] = value
        return kicks, drifts, squares

    def unknowns_of(self, tableau: Tableau) -> Floats:
        """Return the unknowns (n,) of a method with these stages and this role; squares that it has not are 0."""
        outer, inner = tableau.rows_double()
        sizes, squares = self.halves, [0.0] * len(tableau.kick)
        if isinstance(tableau, ModifiedTableau):
            squares = [float(m) for m in tableau.square]
        return np.array([*outer[: sizes[0]], *inner[: sizes[1]], *(squares[i] for i in self.squares)])

    def shape(self) -> Tableau:
        """Return a method with the stages, the role and the squares of all members: leapfrog, s times."""
        step = 1 / self.stages
        rows = {"kick": [step] * self.stages, "drift": [step] * self.stages}
        rows[self.first] = [step / 2, *rows[self.first][1:], step / 2]
        given = {name: tuple(map(repr, row)) for name, row in rows.items()}
        about = {"name": "leapfrog", "order": 2, "first": self.first, "source": "leapfrog", "digits": 14}
        if not self.squares:
            return Tableau(**given, **about)  # type: ignore[arg-type]
        squares = tuple(str(int(self._is_modified(i))) for i in range(len(rows["kick"])))
        return ModifiedTableau(**given, **about, square=squares)  # type: ignore[arg-type]

    def residuals(self, x: Sequence[Any] | Floats) -> list[Any]:
        """Return the values of the equations, 0 for members, for n numbers, mpmath numbers or arrays of floats."""
        number = as_mpf if isinstance(x[0], mpf) else float
        step = word_sums(self._factors(x), [word for row, _ in self.equations for _, word in row])
        return [sum(number(w) * step[word] for w, word in row) - number(total) for row, total in self.equations]

    def project(self, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the members (C, n) of the family near ``points``, and which of them meet the equations.

        Each Newton step is the shortest that the linearised equations allow.
        """
        x = np.array(points, dtype=float)
        values = self._values(x)
        J = np.zeros((*values.shape, self.unknowns))
        for _ in range(PROJECTIONS):
            size = np.abs(values).max(axis=1)
            far = ~(size < NEAR) | ~J.any(axis=(1, 2))
            moving = ~(size < MET * MET)
            if not moving.any():
                break
            if (far & moving).any():
                J[far & moving] = self._slopes(x[far & moving])
            square = J @ J.transpose(0, 2, 1) + 1e-15 * np.eye(values.shape[1])
            step = np.einsum("cen,ce->cn", J, np.linalg.solve(square, values[..., None])[..., 0])
            x -= np.where(moving[:, None], np.clip(np.nan_to_num(step), -LONGEST, LONGEST), 0.0)
            values = self._values(x)
        return x, np.abs(values).max(axis=1) < MET

    def slopes(self, x: Sequence[BigFloat]) -> list[list[BigFloat]]:
        """Return the derivatives of the residuals at mpmath numbers, by differences of half the working precision."""
        h, here, columns = mpf(10) ** (-mp.dps // 2), self.residuals(x), []
        for j in range(len(x)):
            there = self.residuals([value + h * (i == j) for i, value in enumerate(x)])
            columns.append([(b - a) / h for a, b in zip(here, there, strict=True)])
        return [list(row) for row in zip(*columns, strict=True)]

    def grown(self, x: Floats) -> tuple[Family, Floats]:
        """Return the family of one stage more and the same step in it: its innermost operator split by nothing."""
        outer, inner = self.halves
        kicks, drifts, squares = self.rows(x)
        more = replace(self, stages=self.stages + 1)
        a, b = list(x[:outer]), list(x[outer : outer + inner])
        first, second = (kicks, drifts) if self.first == "kick" else (drifts, kicks)
        if self.stages % 2:  # two innermost outer values; the innermost inner one is halved, and nothing stands between
            b_new, a_new = [*b, second[inner] / 2], [*a, first[outer]]
        else:
            a_new, b_new = [*a, first[outer] / 2], [*b, second[inner]]
        a_new, b_new = a_new[: more.halves[0]], b_new[: more.halves[1]]
        return more, np.array([*a_new, *b_new, *(squares[i] for i in self.squares)])

    def _factors(self, x: Sequence[Any] | Floats) -> list[Factor]:
        """The operators of a step in their order."""
        kicks, drifts, squares = self.rows(x)
        modified = [[("B", k), ("C", m)] if self._is_modified(i) else [("B", k)]
                    for i, (k, m) in enumerate(zip(kicks, squares, strict=True))]  # fmt: skip
        plain: list[list[Factor]] = [[("A", c)] for c in drifts]
        rows = (modified, plain) if self.first == "kick" else (plain, modified)
        return [x for i in range(self.stages + 1) for row in rows for group in row[i : i + 1] for x in group]

    def _is_modified(self, kick: int) -> bool:
        kicks = self.stages + (self.first == "kick")
        return min(kick, kicks - 1 - kick) in self.squares

    def _values(self, x: Floats) -> Floats:
        """Residuals (C, equations)."""
        return np.stack(np.broadcast_arrays(*self.residuals(x.T)), axis=1)

    def _slopes(self, x: Floats) -> Floats:
        """Derivatives (C, equations, n)."""
        n = self.unknowns
        moved = (x[:, None, :] + 1j * IMAGINARY * np.eye(n)).reshape(-1, n)
        found = np.stack(np.broadcast_arrays(*self.residuals(moved.T)), axis=1).imag / IMAGINARY
        return found.reshape(len(x), n, -1).transpose(0, 2, 1)


def _closed(half: Sequence[Any] | Floats, length: int) -> list[Any]:
    """The symmetric row of sum 1 that begins with ``half``."""
    start = list(half)
    rest = 1 - 2 * sum(start[1:], start=start[0]) if start else 1.0
    inmost = [rest] if length % 2 else [rest / 2, rest / 2]
    return [*start, *inmost, *reversed(start)]
