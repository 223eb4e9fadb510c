"""Gauss collocation methods: implicit, symplectic, symmetric, and of order 2 s with s stages.

The nodes c_i are the zeros of the Legendre polynomial of degree s on [0, 1], and a_ij the integral of the j-th Lagrange
polynomial of the nodes from 0 to c_i. Source: Hairer, Lubich & Wanner (2006), Geometric Numerical Integration, II.1.3
and IV.2.1. Coefficients are computed with :data:`DIGITS` digits, so that a method is declared by its stages alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.core.layout import StageTable
from nearharmonic.errors import bad_setting, shown
from nearharmonic.integrators.tableau import First, Move, OneStepMethod, Steps, is_count

#: Decimals of the coefficients.
DIGITS = 80
#: Largest error of a moment of the quadrature that is rounding.
TOLERANCE = Fraction(1, 10 ** (DIGITS - 5))
#: Largest number of stages.
MOST_STAGES = 16
#: Bits below the binary point of the coefficients that conditions of symplecticity relate: of doubles, and of pairs.
BITS, BITS_OF_PAIRS = 52, 104
Matrix = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Collocation(OneStepMethod):
    """A Gauss collocation method of s = ``stages`` stages, for any separable H; its order is 2 s.

    A step solves its equations by iteration on the forces at the stages, until they change by no more than their
    rounding. All stages are computed at once, in SIMD lanes. Texts and aliases are as in a
    :class:`~nearharmonic.Tableau`.
    """

    name: str
    label: str
    stages: int
    source: str
    note: str = ""
    aliases: InitVar[tuple[str, ...]] = ()

    implicit = symmetric = True
    benchmarked = modified = processed = first_same_as_last = False
    digits = DIGITS
    requires = processor = harmonic_order = generalised_order = None
    # There are no kicks and drifts. A walk through the registry finds empty rows.
    first = "drift"
    kick = drift = square = outer = inner = ()

    def __post_init__(self, aliases: tuple[str, ...]) -> None:
        object.__setattr__(self, "aliases", aliases)
        self._expect(is_count(self.stages, MOST_STAGES), "stages", self.stages, f"an integer from 1 to {MOST_STAGES}")

    @property
    def order(self) -> int:
        """Order for any separable H."""
        return 2 * self.stages

    @property
    def proved_order(self) -> int:
        """The order of the quadrature, from its nodes and weights."""
        nodes, weights = gauss(self.stages)
        power = 0
        while abs(_moment(nodes, weights, power) * (power + 1) - 1) < TOLERANCE:
            power += 1
        return power

    @property
    def kernel_options(self) -> dict[str, Any]:
        """Settings that the compiled code depends on."""
        return {"stages": self.stages}

    @property
    def moves_per_step(self) -> int:
        """Moves of a kernel in a step: all stages are one."""
        return 1

    @property
    def facts(self) -> dict[str, object]:
        """Properties of the method that a notebook shows, by name."""
        return {
            "name": self.name, "label": self.label, "stages": self.stages, "order": self.order, "kind": "implicit",
            "source": self.source,
        }  # fmt: skip

    def __repr__(self) -> str:
        from nearharmonic.registry import line

        return line("Collocation", self.facts)

    def _repr_html_(self) -> str:
        from nearharmonic.registry import facts_table

        return facts_table("Collocation", self.facts)

    def role(self, first: First | None) -> Collocation:
        """Return the method, which has no first operator; one that is given raises an error."""
        if first is not None:
            raise bad_setting("first", first, f"nothing, as {self.name} is implicit and has no first operator")
        return self

    def moves(self, tau: Fraction = Fraction(1), *, rounded: bool = False) -> list[Move]:
        """Return the moves of a run: a step is one, with the step size in place of a kick."""
        return [(tau, Fraction(0), Fraction(0))] * 3

    def evaluations(self, steps: Steps) -> Steps:
        """Return the smallest number of force evaluations of a run, with one iteration per step; results count all."""
        return steps * self.stages

    def digest(self) -> str:
        """Return a text that determines the results of a run."""
        return f"Gauss collocation of {self.stages} stages"

    @property
    def _kind(self) -> str:
        return f"collocation {shown(self.name)}"


@lru_cache
def stage_table(stages: int) -> StageTable:
    """Return the coefficients of a Gauss method, rounded so that the conditions of symplecticity hold exactly."""
    nodes, weights = gauss(stages)
    momentum = [[x / weights[j] for j, x in enumerate(row)] for row in integrals(nodes)]
    position = [
        [sum((row[k] * weights[k] * momentum[k][j] for k in range(stages)), Fraction(0)) for j in range(stages)]
        for row in momentum
    ]
    c = [_on_grid(x) for x in nodes]
    return StageTable(
        nodes=_pairs(c),
        rest=_pairs([(1 - high, -low) for high, low in c]),
        weights=tuple(rounded_pair(*x.as_integer_ratio()) for x in weights),
        position=_related(position, lambda i, j, half: c[i][half] - c[j][half], -1),
        momentum=_related(momentum, lambda i, j, half: Fraction(1 - half), 1),
        guess=tuple(tuple(rounded_pair(*x.as_integer_ratio()) for x in row) for row in extrapolation(nodes)),
    )


def _on_grid(x: Fraction) -> tuple[Fraction, Fraction]:
    """A multiple of 2^-52 next to x, and a multiple of 2^-104 next to what remains."""
    high = Fraction(round(x * 2**BITS), 2**BITS)
    return high, Fraction(round((x - high) * 2**BITS_OF_PAIRS), 2**BITS_OF_PAIRS)


def _pairs(numbers: Any) -> tuple[tuple[float, float], ...]:
    return tuple((float(high), float(low)) for high, low in numbers)


def _related(matrix: Any, total: Any, sign: int) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Round a matrix so that m_ij + ``sign`` m_ji = ``total(i, j)`` for each half of the pairs."""
    found = [[_on_grid(x) for x in row] for row in matrix]
    for i in range(len(found)):
        for j in range(i):
            found[j][i] = tuple(sign * (total(i, j, half) - found[i][j][half]) for half in (0, 1))
        if sign > 0:
            found[i][i] = tuple(total(i, i, half) / 2 for half in (0, 1))
    return tuple(map(_pairs, found))


@lru_cache
def gauss(stages: int) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """Return the nodes and the weights of Gauss quadrature on [0, 1] to :data:`DIGITS` digits."""
    import mpmath

    with mpmath.workdps(DIGITS + 20):
        x = sorted(
            mpmath.findroot(lambda t: mpmath.legendre(stages, t), (near, near + mpmath.mpf("1e-6")))
            for near in (mpmath.cos(mpmath.pi * (i + 0.75) / (stages + 0.5)) for i in range(stages))
        )
        slopes = [stages * (t * mpmath.legendre(stages, t) - mpmath.legendre(stages - 1, t)) / (t * t - 1) for t in x]
        return (
            tuple(_decimal((1 + t) / 2) for t in x),
            tuple(_decimal(1 / ((1 - t * t) * slope**2)) for t, slope in zip(x, slopes, strict=True)),
        )


def _moment(nodes: Sequence[Fraction], weights: Sequence[Fraction], power: int) -> Fraction:
    return sum((b * c**power for b, c in zip(weights, nodes, strict=True)), Fraction(0))


def _decimal(x: Any) -> Fraction:
    import mpmath

    return Fraction(mpmath.nstr(x, DIGITS, strip_zeros=False))


def _lagrange(nodes: tuple[Fraction, ...], j: int) -> list[Fraction]:
    """Coefficients of the j-th Lagrange polynomial, the constant first."""
    found = [Fraction(1)]
    for k, c in enumerate(nodes):
        if k != j:
            shifted, scale = [Fraction(0), *found], nodes[j] - c
            found = [(a - c * b) / scale for a, b in zip(shifted, [*found, Fraction(0)], strict=True)]
    return found


def integrals(nodes: tuple[Fraction, ...]) -> Matrix:
    """Return a_ij, the integrals of the Lagrange polynomials j from 0 to node i."""
    polynomials = [_lagrange(nodes, j) for j in range(len(nodes))]
    return tuple(
        tuple(sum((a * c ** (k + 1) / (k + 1) for k, a in enumerate(one)), Fraction(0)) for one in polynomials)
        for c in nodes
    )


def extrapolation(nodes: tuple[Fraction, ...]) -> Matrix:
    """Return the values at 1 + node i of the Lagrange polynomials j."""
    polynomials = [_lagrange(nodes, j) for j in range(len(nodes))]
    return tuple(
        tuple(sum((a * (1 + c) ** k for k, a in enumerate(one)), Fraction(0)) for one in polynomials) for c in nodes
    )
