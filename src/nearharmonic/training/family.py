"""Families of symmetric methods, and the registered methods that others are compared with.

Unknowns are the first half of the outer row without its innermost value, the first half of the inner row without its
innermost value, and the squares of the modified kicks. The omitted values make the sums of both rows 1. Order four then
has two more equations; order six for quadratic T has four more, for any number of stages. A harmonic order lambda_H has
one equation kappa_l = 0 for each power of tau from five on (Nielsen 2015, Eq. 17).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators, modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import First, Row, Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.theory.order_conditions import ConditionedSteps

# --- Methods for comparison with trained ones: all registered methods that are not of this project.

#: Prefix of the names of trained methods.
TRAINED = "trained_"
#: Prefix of the names of methods that are trained with the oscillator solved exactly.
TRAINED_EXACT = "trained_exact_"
#: Modules of this project's own methods: found by order conditions, and trained.
OURS = ("nearharmonic_2026", "nearharmonic_2026_modified", "trained", "trained_exact", "trained_polynomial")


def module_of(name: str) -> str:
    """Return the last part of the name of the module that registers a method."""
    return str(integrators.module_of(name)).rpartition(".")[2]


def published_names() -> tuple[str, ...]:
    """Return the names of all published methods without modified potentials."""
    return tuple(name for name in plain_integrators.registered if module_of(name) not in OURS)


def modified_names() -> tuple[str, ...]:
    """Return the names of all methods with modified potentials except processed and trained ones.

    Published methods come first.
    """
    found = [name for name, one in modified_integrators.items() if not (one.processed or name.startswith(TRAINED))]
    return tuple(sorted(found, key=lambda name: module_of(name) in OURS))


def published(methods: Iterable[Tableau]) -> list[Tableau]:
    """Return the methods of other authors among registered ones."""
    return [one for one in methods if module_of(one.name) not in OURS]


# --- Coefficients as Python text, for files that define a tableau.
def palindrome_lines(name: str, row: Row, indent: str) -> list[str]:
    """Return the lines, indented by ``indent``, of a symmetric row as the argument ``name`` of a tableau."""
    half = len(row) // 2
    numbers = [f'"{c}"' for c in row[:half]] + [f'centre="{c}"' for c in row[half : len(row) - half]]
    return [f"{indent}{name}=palindrome(", *(f"{indent}    {number}," for number in numbers), f"{indent}),"]


# --- Families: free coefficients and order conditions.

#: Accepted harmonic orders.
HARMONIC_ORDERS = range(4, 9)


#: Maximum number of Newton steps of a projection on a family, and largest change of an unknown per step.
STEPS, LONGEST = 10, 0.3
#: Residual below which a point fulfils the equations, and residual from which one Newton step, which squares it,
#: reaches the resolution of doubles.
MET, NEAR = 1e-10, 1e-8
#: Regularisation of the matrix of the equations, relative to its size.
REGULAR = 1e-15


@dataclass(frozen=True, kw_only=True)
class Family(ConditionedSteps):
    """Symmetric compositions of s stages that fulfil order conditions.

    Parameters
    ----------
    stages : int
        Stages s of a step.
    first : {"drift", "kick"}
        Operator of the outer row.
    order : {4, 6, 8}
        Order for quadratic T. Without squares, all methods have order 4 for any separable H.
    potential_degree : int, optional
        Degree of V up to which the methods have this order, from 3; any V, if None.
    harmonic_order : int
        Order lambda_H on the harmonic oscillator, 4 to 8.
    generalised_order : tuple of int
        Orders (r1, r2, ...) for H = T + epsilon V in the powers of epsilon, even, from ``order`` on and not increasing;
        T may be an oscillator that is solved exactly.
    squares : tuple of int
        Indices of the kicks with a modified potential, counted from the outermost kick.
    """

    stages: int
    first: First
    order: int = 4
    harmonic_order: int = 4
    squares: tuple[int, ...] = ()
    potential_degree: int | None = None
    generalised_order: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for key, value, known in (
            ("order", self.order, (4, 6, 8)),
            ("harmonic_order", self.harmonic_order, HARMONIC_ORDERS),
            ("first", self.first, ("drift", "kick")),
            ("potential_degree", self.potential_degree, (None, *range(3, 9))),
        ):
            if value not in known:
                raise bad_setting(key, value, f"one of {', '.join(map(str, known))}")
        ladder = (*self.generalised_order, self.order)
        if any(r % 2 or r > 10 for r in ladder) or sorted(ladder, reverse=True) != list(ladder):
            what = f"even orders that do not increase, from 10 to the order {self.order}"
            raise bad_setting("generalised_order", self.generalised_order, what)
        half = (self.stages + (self.first == "kick") + 1) // 2
        if set(self.squares) - set(range(half)) or len(set(self.squares)) < len(self.squares):
            raise bad_setting("squares", self.squares, f"different numbers of kicks, from 0 to {half - 1}")
        if self.unknowns < len(self.equations):
            what = f"at least {len(self.equations)} free coefficients for as many equations, and there are"
            raise bad_setting("stages", self.stages, f"{what} {self.unknowns}")

    @property
    def gradients(self) -> int:
        """Number of force evaluations per step with the gradient of the square of grad V."""
        kicks = self.stages + (self.first == "kick")
        count = sum(1 if 2 * i + 1 == kicks else 2 for i in self.squares)
        return count - (self.first == "kick" and 0 in self.squares)

    def unknowns_of(self, tableau: Tableau) -> Floats:
        """Return the unknowns (n,) of a method with these stages and this role; missing squares are 0."""
        squares = [0.0] * len(tableau.kick)
        if tableau.modified:
            squares = [float(m) for m in tableau.square]
        return np.array(self.halved(*tableau.rows_double(), squares))

    def shape(self) -> Tableau:
        """Return a method with the stages, the role and the squares of all members: s steps of leapfrog."""
        step = 1 / self.stages
        rows = {"kick": [step] * self.stages, "drift": [step] * self.stages}
        rows[self.first] = [step / 2, *rows[self.first][1:], step / 2]
        given = {name: tuple(map(repr, row)) for name, row in rows.items()}
        about = {"name": "leapfrog", "order": 2, "first": self.first, "source": "leapfrog", "digits": 14}
        if self.squares:
            given["square"] = tuple(str(int(self.is_modified(i))) for i in range(len(rows["kick"])))
        return Tableau(**given, **about)  # type: ignore[arg-type]

    def project(self, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the members (C, n) of the family near ``points``, and a mask of those that fulfil the equations.

        Each Newton step is the shortest solution of the linearised equations. Points that fulfil the equations are
        returned bitwise identical: a step would change them by rounding errors of the linear algebra, which differ
        between processors.
        """
        x = np.array(points, dtype=float)
        with np.errstate(all="ignore"):
            moving = np.flatnonzero(~self.met(x))
            for _ in range(STEPS):
                if not moving.size:
                    break
                values, J = self.linearised(x[moving].T)
                square = J @ J.transpose(0, 2, 1)
                size = 1 + np.trace(square, axis1=1, axis2=2)[:, None, None]
                square += REGULAR * size * np.eye(len(values))
                step = (J.transpose(0, 2, 1) @ np.linalg.solve(square, values.T[..., None]))[..., 0]
                x[moving] -= np.clip(np.nan_to_num(step), -LONGEST, LONGEST)
                moving = moving[~(np.abs(values).max(axis=0) < NEAR)]
            return x, self.met(x)

    def met(self, x: Floats) -> NDArray[np.bool_]:
        """Return the mask of the points (C, n) that fulfil the equations."""
        found: NDArray[np.bool_] = np.abs(np.stack(self.residuals(x.T))).max(axis=0) < MET
        return found

    def grown(self, x: Floats) -> tuple[Family, Floats]:
        """Return the family with one more stage, and this step in it: a flow of length 0 splits its innermost flow."""
        outer, inner = self.halves
        kicks, _, squares = self.rows(x)
        rows = self.palindromes(x)
        a, b = list(x[:outer]), list(x[outer : outer + inner])
        if self.stages % 2:  # the innermost inner value is halved, and a new outer value 0 is put between the halves
            a.append(rows[0][outer])
        else:  # the innermost outer value is halved, and a new inner value 0 is put between the halves
            b.append(rows[1][inner])
        halved = [squares[i] / (2 if 2 * i + 1 == len(kicks) else 1) for i in self.squares]
        return replace(self, stages=self.stages + 1), np.array([*a, *b, *halved])
