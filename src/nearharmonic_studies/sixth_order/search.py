"""Search for methods of order six with a harmonic order: equations, criterion, cascade, and a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, astuple, dataclass, field
from fractions import Fraction
from functools import cache
from math import inf
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import mp, mpf

from nearharmonic.core.numba_code import jit
from nearharmonic.engine.trajectory import sweep
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.words import LETTERS
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.integrators import zymplectic
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.numerics.compiled import Damping, RandomStarts, distinct, iteration, levenberg_step
from nearharmonic.numerics.portable import Bools
from nearharmonic.output.table import Table, progress
from nearharmonic.systems import henon_heiles, kepler, sho
from nearharmonic.theory.order_conditions import ConditionedSteps, Equation, alternating
from nearharmonic.training.objective import tableau_of
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings

# --- Equations of symmetric integrators of Nystrom order six with a harmonic order, which are linear in word sums.
#
# A step is a product of exponentials exp(c X), X being A for a drift and B for a kick; S(w) is the coefficient of the
# word w in this product; in the exact exp(A + B) it is 1/n! for a word of n letters. The logarithm of a symmetric step
# has no terms of even degree. The equations by degree are therefore:
#
# - degree 1: both rows sum to 1, which eliminates the innermost value of each row;
# - degree 3: the two order conditions of :func:`~nearharmonic.exact.lie`;
# - degree 5: the four that remain for quadratic kinetic energy. If the lower degrees are exact, the logarithm of the
#   step has the coefficients S(w) - 1/n! on words of five letters, and each condition is a weighted sum of these;
# - degree 7 and beyond, for the harmonic oscillator only: there A and B are nilpotent, so that the powers of tau in the
#   step matrix are the alternating words, and kappa_l = 0 (Nielsen 2015, Eq. 17) reads S(ABAB...) = 1/l!, l letters.
#   Up to l = 6 that follows from the order.
#
# With s stages there are s + 1 coefficients, two sums and lambda_H further equations: s - 1 - lambda_H are free.

Doubles = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Order for quadratic kinetic energy.
NYSTROM_ORDER = 6


@dataclass(frozen=True)
class WordTable:
    """Words in the form for kernels: word i is word ``parent[i]`` followed by the letter ``LETTERS[letter[i]]``.

    The empty word is first, shorter words precede longer ones, and the table has all prefixes of its words.
    """

    words: tuple[str, ...]
    parent: Integers
    letter: Integers

    @classmethod
    def of(cls, needed: Iterable[str]) -> WordTable:
        """Return the table of ``needed`` and their prefixes."""
        closed = {word[:n] for word in needed for n in range(len(word) + 1)}
        words = tuple(sorted(closed, key=lambda word: (len(word), word)))
        place = {word: i for i, word in enumerate(words)}
        parent = np.array([-1, *(place[word[:-1]] for word in words[1:])])
        letter = np.array([-1, *(LETTERS.index(word[-1]) for word in words[1:])])
        return cls(words, parent, letter)

    def weights(self, equations: Sequence[Equation]) -> tuple[Doubles, Doubles]:
        """Return ``equations`` as a matrix (equation, word) and the right-hand sides (equation)."""
        rows = [[float(left.get(word, 0)) for word in self.words] for left, _ in equations]
        return np.array(rows), np.array([float(right) for _, right in equations])


@dataclass(frozen=True)
class NystromEquations(ConditionedSteps):
    """The equations for s ``stages``, the ``first`` operator, and a ``harmonic_order`` lambda_H from 6 to s - 1."""

    stages: int
    first: First
    harmonic_order: int
    order: int = field(default=NYSTROM_ORDER, init=False, repr=False)

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return self.unknowns - self.harmonic_order


# --- Criterion for the ranking; it uses no test problem.
#
#     J = log10 [ (e_H + epsilon e_N) (A / 2) (2 s / tau*) ],
#     e_N = |E_7| (s h)^6,    e_H = |K_7| (s h)^6 + |K_9| (s h)^8 + |K_11| (s h)^10
#
# - |E_7| is the norm of the leading error term for quadratic kinetic energy (nearharmonic.theory.order.error_norm): e_N
#   is the local error per unit time at h = tau/s, the time between two evaluations of the force, so at equal cost.
# - |K_d| is the norm of the error of degree d of the step matrix on the harmonic oscillator: e_H is defined in the same
#   way. Terms beyond the leading one are needed because a harmonic order makes it vanish. Errors of even degree follow
#   from det K = 1.
# - A near-harmonic system is a harmonic system plus epsilon times another one: its error is e_H + epsilon e_N. A
#   harmonic order improves J only until the anharmonic errors dominate.
# - A, the sum of the absolute values of all coefficients, is at least 2: A/2 is the length of all substeps relative to
#   a step without backward substeps. Rounding errors and higher error terms grow with it.
# - tau*/s, the linear stability limit per stage, is at most 2, the limit of leapfrog: 2s/tau* is the reduction.
#
# Both factors are at least 1. h and epsilon set the scale: h = 0.1 corresponds to 63 evaluations of the force per
# period, where such methods begin to be efficient, and epsilon = 0.1 is the meaning of "near".

#: h and epsilon of the criterion.
TAU_PER_STAGE, ANHARMONICITY = 0.1, 0.1
#: Degrees of the harmonic error terms.
HARMONIC_DEGREES = (7, 9, 11)
#: Spacing of the step sizes in the search for the stability limit, and upper end of the search.
SCAN, FARTHEST = 0.02, 8.0


@dataclass(frozen=True)
class Merit:
    """The ingredients of the criterion, e_N, e_H, A and tau*, and its value J."""

    nystrom_error: float
    harmonic_error: float
    sum_of_absolute_values: float
    stability_limit: float
    value: float


def leading_nystrom_error() -> tuple[Equation, ...]:
    """Return the orthonormal coordinates of the error term of degree 7, as equations for its vanishing.

    Words also contain errors of degree 5 that vanish for quadratic kinetic energy. With X = A + B and errors E_5, E_7
    the step is exp(X + E_5 + E_7). Its part of degree 7 is X^7/7! + E_7 + (X X E_5 + X E_5 X + E_5 X X)/6, and E_5 is
    its part of degree 5 minus X^5/5!.
    """
    degree, found = NYSTROM_ORDER + 1, []
    words = lyndon_words(degree)
    for row in conditions(degree, quadratic=True):
        left: dict[str, Fraction] = {}
        right = Fraction(0)
        # The conversion to doubles takes the square root; the weights here are rational.
        for word, weight in zip(words, row.weights, strict=True):
            if weight:
                parts = [(word, Fraction(1)), *((word[k : k + 5], Fraction(-1, 6)) for k in range(3))]
                for part, factor in parts:
                    left[part] = left.get(part, Fraction(0)) + weight * factor
                right += weight * (Fraction(1, 5040) - Fraction(3, 6 * 120))
        found.append((left, right))
    return tuple(found)


class System(NamedTuple):
    """Arrays of the equations ``weights`` S = ``wanted`` for a step of coefficients ``directions`` x + ``offset``.

    ``parent`` and ``letter`` belong to the table of words, ``letters`` to the operators of the step.
    """

    parent: Integers  # (word,)
    letter: Integers  # (word,)
    letters: Integers  # (operator,)
    directions: Doubles  # (operator, unknown)
    offset: Doubles  # (operator,)
    weights: Doubles  # (equation, word)
    wanted: Doubles  # (equation,)


class Criterion(NamedTuple):
    """Arrays of the criterion: errors are ``weights`` S - ``wanted``; ``places`` are indices of alternating words."""

    parent: Integers  # (word,)
    letter: Integers  # (word,)
    weights: Doubles  # (error, word)
    wanted: Doubles  # (error,)
    places: Integers  # (first letter, length)


@cache
def criterion_of(stages: int) -> Criterion:
    """Return the arrays of the criterion for a number of stages."""
    equations = leading_nystrom_error()
    chains = [[alternating(n, start) for n in range(1, 2 * stages + 2)] for start in "AB"]
    table = WordTable.of([*(word for left, _ in equations for word in left), *chains[0], *chains[1]])
    weights, wanted = table.weights(equations)
    for i, row in enumerate(conditions(NYSTROM_ORDER + 1, quadratic=True)):
        weights[i] /= float(row.scale) ** 0.5
        wanted[i] /= float(row.scale) ** 0.5
    places = np.array([[table.words.index(word) for word in chain] for chain in chains])
    return Criterion(table.parent, table.letter, weights, wanted, places)


@cache
def system_of(equations: NystromEquations) -> System:
    """Return the arrays of ``equations``."""
    table = WordTable.of(word for left, _ in equations.equations for word in left)
    letters = (np.arange(2 * equations.stages + 1) + (equations.first == "kick")) % 2  # 0 for a drift, 1 for a kick
    weights, wanted = table.weights(equations.equations)
    return System(table.parent, table.letter, letters, *equations.placement, weights, wanted)


# --- Compiled part: word sums of a step, solutions from many points, and a descent along solutions.
#
# A step is given by ``letters`` and coefficients ``c`` of its operators. A factor exp(c X) at the end of a product adds
# c^k/k! S(v) to S(w) for w = v X^k.

#: Norms of the residuals are in units of kappa, whose rounding error is about 1e-13.
DAMPING = Damping(
    iterations=150, enough=1e-12, solved=1e-10, first=1e-2, fall=(0.15, 1.0), rise=4.0, most=1e10, by_residual=True,
    bounded=True,
)  # fmt: skip
#: Number of steps of Newton's method to the solution near a point.
PROJECTION = Damping(iterations=7, enough=1e-12, solved=1e-12, lost=1.0, monotone=False)


class Walk(NamedTuple):
    """Settings of a walk.

    The length of the random steps is ``first`` at the start, and again once it is below ``least``; it grows by the
    factor ``longer`` after a success and falls by ``shorter`` after a failure.
    """

    first: float = 0.05
    longer: float = 1.6
    shorter: float = 0.85
    least: float = 1e-7


@jit
def solve(system: System, starts: Doubles, bound: float) -> tuple[Doubles, Bools]:
    """Iterate from ``starts`` (start, unknown); return the ends, and the mask of solutions in [-bound, bound]."""
    ends, solved = starts.copy(), np.zeros(len(starts), np.bool_)
    for start in range(len(starts)):
        solved[start] = iterate(system, ends[start], bound, DAMPING)
    return ends, solved


@jit
def descend(
    system: System, criterion: Criterion, bound: float, settings: Walk, noise: Doubles, starts: Doubles
) -> Doubles:
    """Return solutions of lower J, found by random walks with ``noise`` (start, step, unknown) from ``starts``.

    A random step, projected back to the solutions, is accepted if J decreases; its length is adapted to the success.
    """
    ends, trial = starts.copy(), np.empty(starts.shape[1])
    for walk in range(len(ends)):
        x, length = ends[walk], settings.first
        least = merit(system, criterion, x)[4]
        for step in range(noise.shape[1]):
            for u in range(len(x)):
                trial[u] = x[u] + length * noise[walk, step, u]
            better = False
            if iterate(system, trial, bound, PROJECTION):
                value = merit(system, criterion, trial)[4]
                better = value < least
            if better:
                for u in range(len(x)):
                    x[u] = trial[u]
                least = value
                length *= settings.longer
            else:
                length *= settings.shorter
            # A walk with vanishing steps restarts with long steps, because gaps of stability make J discontinuous.
            if length < settings.least:
                length = settings.first
    return ends


@jit
def assess(system: System, criterion: Criterion, solutions: Doubles) -> Doubles:
    """(e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    merits = np.empty((len(solutions), 5))
    for i in range(len(solutions)):
        merits[i, 0], merits[i, 1], merits[i, 2], merits[i, 3], merits[i, 4] = merit(system, criterion, solutions[i])
    return merits


@jit
def residuals(system: System, x: Doubles) -> tuple[Doubles, float, Doubles]:
    """Residuals (equation,) at ``x``, their norm, and the coefficients of the step."""
    weights, wanted, c = system.weights, system.wanted, coefficients(system, x)
    sums = word_sums(system.parent, system.letter, system.letters, c)
    F, square = -wanted, 0.0
    for e in range(len(F)):
        for w in range(len(sums)):
            if weights[e, w] != 0.0:
                F[e] += weights[e, w] * sums[w]
        square += F[e] * F[e]
    return F, np.sqrt(square), c


@jit
def jacobian(system: System, x: Doubles, c: Doubles) -> Doubles:
    """Derivatives of the residuals (equation, unknown) at ``x``, for the coefficients of the step there."""
    weights = system.weights
    slopes = word_slopes(system, c)
    J = np.zeros((len(weights), len(x)))
    for e in range(len(weights)):
        for w in range(len(slopes)):
            if weights[e, w] != 0.0:
                for u in range(len(x)):
                    J[e, u] += weights[e, w] * slopes[w, u]
    return J


@jit
def merit(system: System, criterion: Criterion, x: Doubles) -> tuple[float, float, float, float, float]:
    """(e_N, e_H, A, tau*, J) of the solution ``x`` (unknown)."""
    wanted, weights, places = criterion.wanted, criterion.weights, criterion.places
    c = coefficients(system, x)
    sums = word_sums(criterion.parent, criterion.letter, system.letters, c)
    square = 0.0
    for e in range(len(wanted)):
        error = -wanted[e]
        for w in range(len(sums)):
            error += weights[e, w] * sums[w]
        square += error * error
    stages = len(c) // 2
    tau = stages * TAU_PER_STAGE
    nystrom, harmonic = np.sqrt(square) * tau**NYSTROM_ORDER, 0.0
    for degree in HARMONIC_DEGREES:
        exact = 1.0
        for n in range(2, degree + 1):
            exact /= n
        K12, K21 = sums[places[0, degree - 1]] - exact, sums[places[1, degree - 1]] - exact
        harmonic += np.hypot(K12, K21) * tau ** (degree - 1)
    size = 0.0
    for i in range(len(c)):
        size += abs(c[i])
    limit = first_gap(sums, places)
    value = np.log10((harmonic + ANHARMONICITY * nystrom) * (size / 2) * (2 * stages / limit))
    return nystrom, harmonic, size, limit, value


@jit
def first_gap(sums: Doubles, places: Integers) -> float:
    """Return tau*: the first zero of K12 or K21; (tr K / 2)^2 - 1 = K12 K21 is positive for larger step sizes.

    Both are sums over the alternating words, (-1)^j S(w) tau^(2j + 1) for the word of 2j + 1 letters.
    """
    above = np.ones(2)
    tau, limit = 0.0, FARTHEST
    while tau < limit:
        tau += SCAN
        for k in range(2):
            value = 0.0
            for j in range((places.shape[1] - 1) // 2, -1, -1):
                value = sums[places[k, 2 * j]] - tau * tau * value
            if not value > 0.0:
                # Linear between the two samples: to about SCAN^2.
                limit = min(limit, tau - SCAN * value / (value - above[k]))
            above[k] = value
    return limit


@jit
def coefficients(system: System, x: Doubles) -> Doubles:
    """Return the coefficients of a step from its unknowns."""
    c = system.offset.copy()
    for i in range(len(c)):
        for u in range(len(x)):
            c[i] += system.directions[i, u] * x[u]
    return c


@jit
def word_sums(parent: Integers, letter: Integers, letters: Integers, c: Doubles) -> Doubles:
    """Return S(w) of all words of a ``conditions.WordTable``, given by its arrays."""
    sums = np.zeros(len(parent))
    sums[0] = 1.0
    for i in range(len(letters)):
        # Longer words first: they need the old sums of shorter words.
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                sums[w] += factor * sums[v]
                while letter[v] == letters[i]:
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
                    sums[w] += factor * sums[v]
    return sums


@jit
def word_slopes(system: System, c: Doubles) -> Doubles:
    """Return derivatives (word, unknown) of S(w) for all words of the equations."""
    parent, letter, letters, directions = system.parent, system.letter, system.letters, system.directions
    unknowns = directions.shape[1]
    sums, slopes = np.zeros(len(parent)), np.zeros((len(parent), unknowns))
    sums[0] = 1.0
    for i in range(len(letters)):
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                while True:
                    sums[w] += factor * sums[v]
                    for u in range(unknowns):
                        slopes[w, u] += factor * slopes[v, u]
                    if letter[v] != letters[i]:
                        break
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
        # d exp(c X) = exp(c X) X dc: the sums already include the operator.
        for w in range(1, len(parent)):
            if letter[w] == letters[i]:
                for u in range(unknowns):
                    slopes[w, u] += directions[i, u] * sums[parent[w]]
    return slopes


iterate = iteration(residuals, jacobian, levenberg_step)


# --- Search for sixth-order near-harmonic methods: a cascade of random starts, walks along families, and a ranking.
#
# For each number of stages and each first operator, the search from random points finds solutions of order six.
# Starts near these find solutions of the next harmonic order, and so on until there are no free parameters. Without
# the cascade one of fifty random starts would find an isolated solution of eight stages, and one of thousands a
# solution of ten.

#: Bound of the unknowns of the solutions that are kept: methods with longer substeps are not useful.
BOUND = 2.0
#: Standard deviation and maximum number of the starts near a solution, for the search at the next harmonic order.
NEAR, MOST_NEAR = 0.1, 20
#: Minimum distance (largest difference) between the starts of walks along a family.
APART = 0.05


@dataclass(frozen=True)
class Count:
    """Search results of one kind; ``solutions`` counts distinct solutions, or samples with free parameters."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    starts: int
    hits: int
    solutions: int


@dataclass(frozen=True)
class Candidate:
    """A solution: unknowns, number of starts that led there (0 after a walk along its family), and merit."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    unknowns: tuple[float, ...]
    hits: int
    merit: Merit

    @property
    def composition(self) -> str:
        """BAB if the kick is first, else ABA."""
        return "BAB" if self.first == "kick" else "ABA"

    def row(self) -> dict[str, str | int | float]:
        """The line of a table."""
        plain = {key: getattr(self, key) for key in ("composition", "stages", "harmonic_order", "free", "hits")}
        return plain | asdict(self.merit) | {"unknowns": " ".join(f"{x:.15g}" for x in self.unknowns)}


@dataclass(frozen=True)
class Findings:
    """``counts`` by stages, first and harmonic order; ``candidates`` by merit, the best first."""

    counts: tuple[Count, ...]
    candidates: tuple[Candidate, ...]


def find_solutions(
    settings: SixthOrderSettings,
    *,
    stages: tuple[int, ...] = (7, 8, 9, 10, 11),
    firsts: tuple[First, ...] = ("kick", "drift"),
    threads: int = 1,
) -> Findings:
    """Find and rank solutions of Nystrom order six for all stages, first operators and harmonic orders.

    With fewer than 7 stages there is no solution; more than 11 have not been searched. The result does not depend on
    ``threads``.
    """
    # The longest tasks first, so that all threads finish together.
    tasks = [(s, first) for s in sorted(stages, reverse=True) for first in firsts]
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(lambda task: list(_cascade(task[0], task[1], settings)), tasks))
    levels = [level for levels in found for level in levels]
    counts = sorted((count for count, _ in levels), key=lambda c: (c.stages, c.first, c.harmonic_order))
    candidates = sorted((c for _, best in levels for c in best), key=lambda c: (c.merit.value, c.unknowns))
    return Findings(tuple(counts), tuple(candidates))


def winners(findings: Findings) -> tuple[Candidate, ...]:
    """Return the four best candidates of a harmonic order above their order, one per number of stages and composition.

    Candidates of one family, and of successive harmonic orders, are similar: one represents all.
    """
    chosen: dict[tuple[int, First], Candidate] = {}
    for candidate in findings.candidates:
        if candidate.harmonic_order > NYSTROM_ORDER:
            chosen.setdefault((candidate.stages, candidate.first), candidate)
    return tuple(chosen.values())[:4]


def _cascade(stages: int, first: First, settings: SixthOrderSettings) -> Iterator[tuple[Count, list[Candidate]]]:
    starts = RandomStarts(settings.starts, (settings.seed, stages, first == "kick"), bound=BOUND)
    random = starts.generator()
    points = starts.points(random, stages - 1)
    for harmonic_order in range(NYSTROM_ORDER, stages):
        equations = NystromEquations(stages, first, harmonic_order)
        found, solved = solve(system_of(equations), points, starts.bound)
        hits = found[solved]
        solutions, multiplicity = distinct(hits[np.lexsort(hits.T[::-1])], starts.same)
        count = Count(stages, first, harmonic_order, equations.free, len(points), len(hits), len(solutions))
        if equations.free:
            solutions = _walked(equations, solutions, settings, random)
            best = candidates_of(equations, solutions, [0] * len(solutions))
        else:
            best = candidates_of(equations, solutions, multiplicity)
        progress(_sentence(count, best))
        yield count, best
        # The ends of the walks are near good methods of the next harmonic order.
        points = _near(np.concatenate([hits, solutions]), settings.starts, random)


def _near(hits: Doubles, wanted: int, random: np.random.Generator) -> Doubles:
    """Return about ``wanted`` points: each of ``hits``, and points near it."""
    copies = min(MOST_NEAR, max(1, wanted // max(1, len(hits))))
    near = np.repeat(hits, copies, axis=0)[: max(wanted, len(hits))]
    noise = random.normal(0, NEAR, near.shape)
    noise[::copies] = 0
    return np.ascontiguousarray(near + noise)


def _walked(
    equations: NystromEquations,
    samples: Doubles,
    settings: SixthOrderSettings,
    random: np.random.Generator,
) -> Doubles:
    """Return the distinct ends of walks from the best ``samples`` (solution, unknown) of a family."""
    values = assessed(equations, samples)[:, 4]
    ends, _ = distinct(samples[np.argsort(values, kind="stable")], APART, most=settings.walks)
    noise = random.normal(0, 1, (len(ends), settings.walk_steps, equations.unknowns))
    ends = descend(system_of(equations), criterion_of(equations.stages), BOUND, Walk(), noise, ends)
    return distinct(ends[np.argsort(assessed(equations, ends)[:, 4], kind="stable")], APART)[0]


def assessed(equations: NystromEquations, solutions: Doubles) -> Doubles:
    """Return (e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    return assess(system_of(equations), criterion_of(equations.stages), solutions)


def candidates_of(equations: NystromEquations, solutions: Doubles, multiplicity: Sequence[int]) -> list[Candidate]:
    """Return ``solutions`` (solution, unknown) with their merits, the best first."""
    kind = (equations.stages, equations.first, equations.harmonic_order, equations.free)
    rows = [
        Candidate(*kind, tuple(map(float, x)), hits, Merit(*map(float, merit)))
        for x, hits, merit in zip(solutions, multiplicity, assessed(equations, solutions), strict=True)
    ]
    return sorted(rows, key=lambda row: row.merit.value)


def _sentence(count: Count, best: list[Candidate]) -> str:
    composition = "BAB" if count.first == "kick" else "ABA"
    kind = "isolated" if count.free == 0 else f"{count.free} free"
    merit = f", best J = {best[0].merit.value:.2f}" if best else ""
    return (
        f"{count.stages} stages, {composition}, harmonic order {count.harmonic_order} ({kind}): "
        f"{count.hits} of {count.starts} starts, {count.solutions} solutions{merit}"
    )


# --- Conversion of a candidate in doubles to a registered tableau: name, rounded free parameters, and all digits.
#
# Newton's method in multiprecision gives any number of digits; free parameters are fixed as short decimals.

#: Decimals of rounded free parameters: the criterion changes by less than 1e-3.
DECIMALS = 4


def registered(candidate: Candidate, *, source: str, digits: int = 76) -> Tableau:
    """Return the tableau of a candidate, with a name like in the paper and the order before the harmonic order.

    Raises NotConvergedError: the equations have no solution near the rounded candidate.
    """
    equations = NystromEquations(candidate.stages, candidate.first, candidate.harmonic_order)
    fixed = short_decimals(equations, candidate.unknowns, DECIMALS)
    stem, order = f"{candidate.composition}s{candidate.stages}o{NYSTROM_ORDER}", candidate.harmonic_order
    values = " and ".join(fixed[u] for u in sorted(fixed))
    note = f"{len(fixed)} free, fixed at {values}" if fixed else "nothing is free"
    return tableau_of(
        equations, candidate.unknowns, digits=digits, fixed=fixed, nearest=inf, name=f"{stem.lower()}_{order}h",
        label=f"{stem},{order}H", source=source, note=note, harmonic_order=order,
    )  # fmt: skip


def short_decimals(equations: NystromEquations, x: Sequence[float], decimals: int) -> dict[int, str]:
    """Choose the free parameters of a family: the unknowns that vary most along it at the solution ``x``.

    The other unknowns are then well-conditioned functions of them. The result has the value of each chosen unknown,
    rounded to ``decimals``, by its index.
    """
    with mp.workdps(40):
        J = np.array(equations.slopes(list(map(mpf, x))), dtype=float)
    directions = np.linalg.svd(J)[2][equations.harmonic_order :].T
    chosen: dict[int, str] = {}
    for _ in range(equations.free):
        u = int(np.argmax(np.sum(directions**2, axis=1)))
        chosen[u] = f"{x[u]:.{decimals}f}"
        row = directions[u] / np.linalg.norm(directions[u])
        directions = directions - np.outer(directions @ row, row)
    return chosen


# --- The whole search, from a seed to refined methods, and a comparison with other methods.

SOURCE = "found by nearharmonic_studies.sixth_order"
#: Published methods of this kind: 6A8.
PUBLISHED = zymplectic.TABLEAUS


def search(
    settings: SixthOrderSettings, integrators: Sequence[str], threads: int
) -> dict[str, Table | Mapping[str, Any]]:
    """Search for methods of order six with a harmonic order, and compare them with :data:`PUBLISHED` and other methods.

    Among the ``integrators``, methods with modified potentials are omitted. The result does not depend on ``threads``.

    The result has ``document``, for a TOML file, and a :class:`Table` for each other key.
    """
    findings = find_solutions(settings, threads=threads)
    best = [(candidate, registered(candidate, source=SOURCE)) for candidate in winners(findings)]
    plain = [methods_by_name[name] for name in integrators if not methods_by_name[name].modified]
    others = plain + [one for one in PUBLISHED if one.name not in integrators]
    compared = [*others, *(tableau for _, tableau in best)]
    return {
        "document": document(best),
        "sixth_order_counts": counts(findings),
        "sixth_order_ranking": ranking(findings.candidates),
        "sixth_order_measured": measured(compared),
    }


#: Candidates that the ranking shows.
RANKED = 40
#: Comparison of the winners: systems, and step sizes per stage in their units of time, from coarse to fine.
MEASURED = (
    (sho.SYSTEM, (0.3, 0.2, 0.1, 0.05, 0.03)),
    (henon_heiles.SYSTEM, (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01)),
    (kepler.SYSTEM, (30.0, 20.0, 10.0, 5.0, 3.0, 2.0)),
)


def counts(findings: Findings) -> Table:
    """Tabulate the numbers of solutions of each kind, or of samples if parameters are free."""
    header = ("stages", "first", "harmonic order", "free parameters", "starts", "hits", "distinct solutions")
    rows = [astuple(count) for count in findings.counts]
    return Table(header=header, rows=rows, caption="Solutions by stages, composition and harmonic order.")


def ranking(candidates: Sequence[Candidate]) -> Table:
    """Tabulate the best candidates by the criterion, which uses no benchmark problem."""
    rows = [candidate.row() for candidate in candidates[:RANKED]]
    return Table(
        header=tuple(rows[0]) if rows else (),
        rows=[tuple(row.values()) for row in rows],
        caption="Best candidates by a criterion that runs no problem.",
    )


def measured(methods: Iterable[Tableau]) -> Table:
    """Measure the largest and mean energy error of each method at equal cost on each system, and its rank."""
    header = ("system", "tau/s", "method", "order", "max energy error", "mean energy error", "rank by maximum")
    tableaus, rows = list(methods), []
    for system, grid in MEASURED:
        runs = {t.name: sweep(system, t, [tau * t.stages for tau in grid], precision="extended") for t in tableaus}
        for i, tau in enumerate(grid):
            worst = {name: run.max_energy_error.values[i] for name, run in runs.items()}
            places = {name: place + 1 for place, name in enumerate(sorted(worst, key=worst.__getitem__))}
            for tableau in tableaus:
                mean = float(runs[tableau.name].mean_energy_error.values[i])
                place = places[tableau.name]
                rows.append((
                    system.label, tau, tableau.label, tableau.order, float(worst[tableau.name]), mean, place,
                ))  # fmt: skip
    return Table(header=header, rows=rows, caption="Energy errors of the winners and others at equal cost.")


def document(found: Iterable[tuple[Candidate, Tableau]]) -> Mapping[str, Any]:
    """Return the polished winners with every digit, for a TOML file."""
    methods = [
        {key: getattr(tableau, key) for key in ("name", "label", "first")}
        | {"kick": list(tableau.kick), "drift": list(tableau.drift), "digits": tableau.digits, "note": tableau.note}
        | {"criterion": candidate.row()}
        for candidate, tableau in found
    ]
    return {"method": methods}
