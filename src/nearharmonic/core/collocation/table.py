"""Coefficients of a collocation method as pairs of doubles, in the form in which rounded numbers stay symplectic.

With the increments L_j = h b_j f(Q_j) of the momentum, the stages of q'' = a(f(q)) are Q_i = q + h (c_i v + sum_j
alpha_ij a(L_j)), and the step is p += sum_j L_j, q += h (v + sum_j (1 - c_j) a(L_j)). It is symplectic for any weights
b_j if alpha_ij - alpha_ji = c_i - c_j. For a kinetic energy that is not quadratic, P_i = p + sum_j mu_ij L_j and Q_i =
q + sum_j mu_ij M_j with M_j = h b_j v(P_j), which is symplectic if mu_ij + mu_ji = 1. Both hold exactly for the numbers
of a :class:`StageTable`: Antonana, Makazaga & Murua (2017), arXiv:1702.03354, and for second order arXiv:2511.03655.
"""

from __future__ import annotations

from dataclasses import dataclass

#: A double and the digits below it.
Number = tuple[float, float]
Vector = tuple[Number, ...]


@dataclass(frozen=True)
class StageTable:
    """Coefficients of a method of s stages.

    Attributes
    ----------
    nodes, rest, weights : tuple of s pairs
        c_i, 1 - c_i and b_i.
    position, momentum, guess : tuple of s tuples of s pairs
        alpha_ij; mu_ij; and the matrix that extrapolates forces to the stages of the next step.
    """

    nodes: Vector
    rest: Vector
    weights: Vector
    position: tuple[Vector, ...]
    momentum: tuple[Vector, ...]
    guess: tuple[Vector, ...]

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.nodes)
