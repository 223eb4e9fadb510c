"""The phi^4 field on a square lattice with periodic edges, in its symmetric phase near the transition.

U = sum over sites of (differences to two neighbours)^2/2 + m phi^2/2 + l phi^4/4. For l = 1 the transition is at
m = -1.2723: W. Loinaz and R. S. Willey, Phys. Rev. D 58, 076003 (1998), doi:10.1103/PhysRevD.58.076003.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic_studies.samplers.targets.target import Target

#: Coefficients m and l, and proposals from a random start.
MASS, COUPLING, WARM = -1.0, 1.0, 400


def _gradient_of(edge: int) -> Any:
    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        total = 0.0
        for i in range(edge):
            row, above, below = i * edge, (i - 1 if i else edge - 1) * edge, (i + 1 if i + 1 < edge else 0) * edge
            for j in range(edge):
                right, left = (j + 1 if j + 1 < edge else 0), (j - 1 if j else edge - 1)
                x = q[row + j]
                two = q[row + right] + q[below + j]
                both = two + q[row + left] + q[above + j]
                square = x * x
                out[row + j] = x * (4.0 + MASS + COUPLING * square) - both
                total += square * (2.0 + 0.5 * MASS + 0.25 * COUPLING * square) - x * two
        return total

    return gradient


@compiled
def observe(q, potential, out):  # type: ignore[no-untyped-def]
    """Write the mean of the field, its square, and U."""
    out[0] = q.sum() / len(q)
    out[1], out[2] = out[0] * out[0], potential


def lattice(n: int) -> Target:
    """Return the target on a lattice of at most n sites."""
    edge = int(n**0.5)

    def start(normal: Normal) -> Floats:
        found: Floats = 0.5 * normal.rows(1, edge * edge)[0]
        return found

    return Target(
        name="lattice",
        label=rf"$\phi^4$ field, {edge} $\times$ {edge} sites",
        dimension=edge * edge,
        highest=3.0,
        lengths=(1.5, 3.0, 6.0),
        gradient=_gradient_of(edge),
        observe=observe,
        observables=("mean field", "its square", "U"),
        start=start,
        warm=WARM,
    )
