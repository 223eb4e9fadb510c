"""Force gradients by differences: two opposite kicks around a short drift act as a kick of a modified potential.

exp(a B) exp(d A) exp(b B) has the logarithm (a + b) B + d A + (d/2) (a - b) [B, A] + m C + ..., where C = [B, [A, B]]
is the kick of the square of grad V and m = -d (a^2 - 4 a b + b^2) / 12. With kicks of opposite sign and a short
backward drift the net kick is that of V - (m / (a + b)) tau^2 |grad V|^2, like the middle kick of Chin (1997), but it
needs no second derivative of V. Yin & Mawhinney (2011), arXiv:1111.5059, use a force at a shifted position for this
purpose.
"""

from __future__ import annotations

from dataclasses import dataclass

from nearharmonic.integrators.order_conditions import step_of
from nearharmonic.integrators.tableau import Tableau

#: Longest drift, and smallest absolute value of a kick, in units of tau.
SHORT, LARGE = 0.03, 0.2


@dataclass(frozen=True)
class ShiftedKick:
    """Two kicks around a short drift: their positions in the step and their coefficients in units of tau.

    ``net`` is the sum of the kicks, ``square`` the coefficient m of C in units of tau^3.
    """

    place: int
    before: float
    drift: float
    behind: float

    @property
    def net(self) -> float:
        """Sum a + b of the kicks."""
        return self.before + self.behind

    @property
    def square(self) -> float:
        """Coefficient m of C."""
        return -self.drift * (self.before**2 - 4 * self.before * self.behind + self.behind**2) / 12


def shifted_kicks(tableau: Tableau) -> list[ShiftedKick]:
    """Return the pairs of large kicks of opposite sign around a short drift, in the order of a step."""
    step = [(letter, float(c)) for letter, c in step_of(tableau)]
    return [
        ShiftedKick(i // 2, a, d, b)
        for i, ((letter, a), (_, d), (_, b)) in enumerate(zip(step, step[1:], step[2:], strict=False))
        if letter == "B" and a * b < 0 and abs(d) < SHORT and min(abs(a), abs(b)) > LARGE
    ]
