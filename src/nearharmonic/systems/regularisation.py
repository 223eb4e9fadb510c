"""Kepler's problem as a perturbed oscillator: the regularisations of Levi-Civita and of Kustaanheimo and Stiefel.

For H = |p|^2/2 - GM/r + R(q) with H = -w < 0, let u be coordinates with q = L(u) u and r = |u|^2, s a fictitious time
with dt = r ds, and v = du/ds the momenta. Then r (H + w) / 4 = |v|^2/2 + w |u|^2/4 + |u|^2 R/4 - GM/4. This is an
oscillator of frequency sqrt(w/2), perturbed by |u|^2 R/4. It is separable, and quadratic in the momenta. Energy and
time are one more conjugate pair: the position w = -H, on which T does not depend, and the momentum -t/4, since dV/dw =
|u|^2/4.

L(u) is a matrix with orthogonal columns. In the plane it is the matrix of Levi-Civita (1920), doi:10.1007/BF02404404,
where q = u^2 as complex numbers. In space it is the matrix of Kustaanheimo & Stiefel (1965),
doi:10.1515/crll.1965.218.204, with four coordinates; the start satisfies their bilinear relation. Source of both:
Stiefel & Scheifele (1971), Linear and Regular Celestial Mechanics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.arithmetic import sqrt

Vector = tuple[Any, ...]


@dataclass(frozen=True)
class Regularisation:
    """Regularisation of a system with an attracting centre, which removes the singularity.

    Parameters
    ----------
    gravity : str
        Name of the parameter GM.
    perturbation : callable, optional
        R as ``f(q, r, *parameters)``. The argument r = |q| is known, so that R need not compute a root.
    strength : str, optional
        Name of a parameter that is a factor of R: if it is 0, R is not computed.
    """

    gravity: str
    perturbation: Callable[..., Any] | None = None
    strength: str | None = None


@dataclass(frozen=True)
class RegularisedFormulas:
    """The formulas and the maps of a regularised system, for numbers of any type.

    Positions are ``u``, 2 coordinates in the plane and 4 in space, followed by w. Momenta are ``v`` followed by -t/4.
    ``gravity`` is the index of GM among the parameters, and ``dimension`` that of physical space, 2 or 3.
    """

    regularisation: Regularisation
    gravity: int
    dimension: int

    @property
    def coordinates(self) -> int:
        """Number of coordinates, including w."""
        return 3 if self.dimension == 2 else 5

    def V(self, x: Vector, *parameters: Any) -> Any:
        """Return |u|^2 (w + R)/4."""
        *u, w = x
        r = _square(u)
        field = w if self.regularisation.perturbation is None else w + self._perturbation(tuple(u), r, *parameters)
        return r * field / 4

    def T(self, y: Vector, *_: Any) -> Any:
        """Return |v|^2/2; it does not depend on the momentum of w."""
        return _square(y[:-1]) / 2

    def _perturbation(self, u: Vector, r: Any, *parameters: Any) -> Any:
        assert self.regularisation.perturbation is not None
        return self.regularisation.perturbation(self._position(u), r, *parameters)

    def _position(self, u: Vector) -> Vector:
        return tuple(sum(a * b for a, b in zip(row, u, strict=True)) for row in _matrix(u)[: self.dimension])

    def energies(self, x: Vector, y: Vector, *parameters: Any) -> tuple[Any, Any]:
        """Return |p|^2/2 = 2 |v|^2/r, and -GM/r + R."""
        u, v = x[:-1], y[:-1]
        r = _square(u)
        V = -parameters[self.gravity] / r
        if self.regularisation.perturbation is not None:
            V = V + self._perturbation(u, r, *parameters)
        return 2 * _square(v) / r, V

    def from_physical(self, q: Vector, p: Vector, *parameters: Any) -> tuple[Vector, Vector]:
        """Return (u, w) and (v, -t/4) of a physical state at t = 0."""
        r = sqrt(_square(q))
        u = self._root(q, r)
        momenta = (*p, *[p[0] * 0] * (len(u) - len(p)))
        v = tuple(sum(row[k] * c for row, c in zip(_matrix(u), momenta, strict=True)) / 2 for k in range(len(u)))
        w = parameters[self.gravity] / r - _square(p) / 2
        if self.regularisation.perturbation is not None:
            w = w - self.regularisation.perturbation(q, r, *parameters)
        return (*u, w), (*v, w * 0)

    def to_physical(self, x: Vector, y: Vector) -> tuple[Vector, Vector]:
        """Return q = L(u) u and p = 2 L(u) v / r."""
        u, v = x[:-1], y[:-1]
        r = _square(u)
        rows = _matrix(u)[: self.dimension]
        return self._position(u), tuple(2 * sum(a * b for a, b in zip(row, v, strict=True)) / r for row in rows)

    def inverse_axis(self, x: Vector, *parameters: Any) -> Any:
        """Return 1/a = 2 w/GM with the semi-major axis a: the period of an orbit in s over its period in t."""
        return 2 * x[-1] / parameters[self.gravity]

    def largest_radius(self, x: Vector, y: Vector, *parameters: Any) -> Any:
        """Return the distance a (1 + e) of the apoapsis of the unperturbed orbit."""
        u, v, GM = x[:-1], y[:-1], parameters[self.gravity]
        a = GM / (2 * x[-1])
        cosine, sine = 1 - _square(u) / a, 2 * sum(b * c for b, c in zip(u, v, strict=True))
        return a * (1 + sqrt(cosine * cosine + sine * sine / (GM * a)))

    def _root(self, q: Vector, r: Any) -> Vector:
        """u with L(u) u = q: from the larger of two possible roots, so that nothing cancels."""
        right = (1 + _sign(q[0])) / 2
        large = sqrt((r + abs(q[0])) / 2)
        small = [c / (2 * large) for c in q[1:]]
        first, second = _swapped(right, large, small[0])
        if self.dimension == 2:
            return first, second
        fourth, third = _swapped(right, large * 0, small[1])
        return first, second, third, fourth


def _swapped(right: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """(a, b) if ``right`` is 1, (b, a) if it is 0: exact, and without a branch."""
    left = 1 - right
    return right * a + left * b, left * a + right * b


def _sign(x: Any) -> Any:
    return x.sign() if hasattr(x, "sign") else (x >= 0) * 2 - 1


def _square(x: Any) -> Any:
    return sum(c * c for c in x)


def _matrix(u: Vector) -> tuple[Vector, ...]:
    """L(u), whose rows are orthogonal and have the length |u|."""
    if len(u) == 2:
        return (u[0], -u[1]), (u[1], u[0])
    a, b, c, d = u
    return (a, -b, -c, d), (b, a, -d, -c), (c, d, a, b), (d, -c, b, -a)
