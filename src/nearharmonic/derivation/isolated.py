"""Every real solution of a case with nothing left free: searched for, counted exactly, polished and proved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import mp, mpf

from nearharmonic.derivation.elimination import eliminate
from nearharmonic.derivation.equations import Equations
from nearharmonic.derivation.polish import polish
from nearharmonic.derivation.proof import prove
from nearharmonic.derivation.search import search
from nearharmonic.tableau import Tableau

#: The cases of Nielsen (2015) that leave nothing free, as (stages, harmonic order).
CASES = ((5, 6), (6, 7), (7, 8))
#: Stages up to which elimination takes seconds; 9 stages have a ring of 126 dimensions and take minutes.
ELIMINABLE_STAGES = 8


@dataclass(frozen=True)
class Root:
    """One real solution: decimal strings of both rows, and how well it is known.

    ``residual`` is the largest |kappa| up to the harmonic order. ``proved``: by Krawczyk's test, exactly one solution
    lies within ``radius`` of each unknown, which is at most ``distance`` from it. ``hits`` counts the random starts
    that led here, and ``eliminated`` tells whether elimination finds it as well. ``higher`` holds |kappa| of the three
    orders that follow.
    """

    outer: tuple[str, ...]
    inner: tuple[str, ...]
    residual: Any
    proved: bool
    radius: Any
    distance: Any
    hits: int
    eliminated: bool
    sum_of_absolute_values: float
    largest_coefficient: float
    higher: tuple[float, ...]

    def tableau(self, equations: Equations, name: str, digits: int) -> Tableau:
        """This solution as an integrator of order 4, rounded to ``digits`` decimals."""
        outer, inner = (tuple(_rounded(c, digits) for c in row) for row in (self.outer, self.inner))
        kick, drift = (outer, inner) if equations.first == "kick" else (inner, outer)
        return Tableau(
            name=name,
            label=name,
            order=4,
            first=equations.first,
            kick=kick,
            drift=drift,
            source=f"derived: {equations.stages} stages, harmonic order {equations.harmonic_order}",
            digits=digits - 1,
            harmonic_order=equations.harmonic_order,
        )


@dataclass(frozen=True)
class Isolated:
    """The real solutions of one case, by the sum of their absolute values.

    ``complex_solutions`` is the exact number of complex solutions, and ``real_solutions`` that of the real ones, by
    Sturm's theorem; None where elimination was left out. ``complete``: as many distinct solutions were proved, so none
    is missing, with coefficients of whatever size. Otherwise the roots are those that the search found in its ``box``
    with no unknown beyond ``bound``. ``unfinished`` says of each candidate that was not polished to its digits, or not
    proved, how far it came.
    """

    equations: Equations
    roots: tuple[Root, ...]
    complex_solutions: int | None
    real_solutions: int | None
    complete: bool
    starts: int
    converged: int
    box: float
    bound: float
    unfinished: tuple[str, ...]


def solve(
    equations: Equations,
    *,
    starts: int,
    seed: int,
    box: float = 2.5,
    bound: float = 20.0,
    digits: int = 128,
    exact: bool | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Isolated:
    """All real solutions of ``equations``: from random starts, and by elimination if ``exact`` (None: up to 8 stages).

    Raises:
        SettingError: a case with free parameters, or no start.
    """
    found = search(equations, starts=starts, seed=seed, box=box, bound=bound, report=report)
    exact = equations.stages <= ELIMINABLE_STAGES if exact is None else exact
    elimination = eliminate(equations) if exact else None
    candidates = [(tuple(point.tolist()), hits, False) for point, hits in zip(found.points, found.hits, strict=True)]
    for start in elimination.starts if elimination else ():
        candidates = _joined(candidates, start)
    roots: list[Root] = []
    unfinished: list[str] = []
    for start, hits, eliminated in candidates:
        outcome = _root(equations, start, digits, hits, eliminated)
        if isinstance(outcome, str):
            unfinished.append(outcome)
        else:
            roots.append(outcome)
        report(f"{equations.stages} stages, harmonic order {equations.harmonic_order}: {len(roots)} solutions proved")
    roots.sort(key=lambda root: root.sum_of_absolute_values)
    complete = bool(elimination and elimination.simple and elimination.real_solutions == len(roots) and not unfinished)
    return Isolated(
        equations=equations,
        roots=tuple(roots),
        complex_solutions=elimination.complex_solutions if elimination else None,
        real_solutions=elimination.real_solutions if elimination else None,
        complete=complete,
        starts=found.starts,
        converged=found.converged,
        box=box,
        bound=bound,
        unfinished=tuple(unfinished),
    )


def _joined(
    candidates: list[tuple[tuple[Any, ...], int, bool]], start: Sequence[Any]
) -> list[tuple[tuple[Any, ...], int, bool]]:
    """``candidates`` with the solution that elimination found marked, or added if no start led to it."""
    scale = max(1.0, *(abs(float(c)) for c in start))
    for i, (point, hits, _) in enumerate(candidates):
        if max(abs(float(a) - b) for a, b in zip(start, point, strict=True)) < 1e-6 * scale:
            return [*candidates[:i], (point, hits, True), *candidates[i + 1 :]]
    return [*candidates, (tuple(start), 0, True)]


def _root(equations: Equations, start: Sequence[Any], digits: int, hits: int, eliminated: bool) -> Root | str:
    polished = polish(equations, start, digits=digits)
    place = ", ".join(f"{float(c):.6f}" for c in start)
    if not polished.converged:
        return f"({place}): Newton's method reached a residual of {mp.nstr(polished.residual, 3)}, not 1e-{digits}"
    proof = prove(equations, polished.unknowns, radius=f"1e-{digits * 3 // 4}")
    if not proof.proved:
        reach = mp.nstr(proof.distance, 3)
        return f"({place}): no proof within {mp.nstr(proof.radius, 3)}: the image of Krawczyk's test reaches {reach}"
    coefficients = [abs(float(c)) for c in (*polished.outer, *polished.inner)]
    highest = equations.harmonic_order
    with mp.workdps(30):
        higher = equations.errors([mpf(c) for c in polished.unknowns], highest + 3)[highest:]
    return Root(
        outer=polished.outer,
        inner=polished.inner,
        residual=polished.residual,
        proved=True,
        radius=proof.radius,
        distance=proof.distance,
        hits=hits,
        eliminated=eliminated,
        sum_of_absolute_values=sum(coefficients),
        largest_coefficient=max(coefficients),
        higher=tuple(abs(float(k)) for k in higher),
    )


def _rounded(text: str, digits: int) -> str:
    with mp.workdps(len(text) + 5):
        scaled = int(mp.nint(mpf(text) * mpf(10) ** digits))
    body = str(abs(scaled)).rjust(digits + 1, "0")
    return f"{'-' if scaled < 0 else ''}{body[:-digits]}.{body[-digits:]}"
