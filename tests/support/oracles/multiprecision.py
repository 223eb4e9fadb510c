"""The oracle of the contract tests: a step in mpmath that shares no code with the kernel, reading the same strings."""

from __future__ import annotations

from mpmath import mp, mpf, sqrt

from nearharmonic.core.formulas.number import Constant, Number, constant
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import System


def trajectory(tableau: Tableau, system: System, tau, steps, state=None):
    """States (q, p) after 0, 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision."""
    rows = {"drift": [mpf(c) * tau for c in tableau.drift], "kick": [mpf(c) * tau for c in tableau.kick]}
    constants = [mpf(parameter.value) for parameter in system.parameters.values()]
    q, p = state or ([mpf(x) for x in system.q0], [mpf(x) for x in system.p0])
    states = [(q, p)]
    operators = [tableau.first, "kick" if tableau.first == "drift" else "drift"] * tableau.stages + [tableau.first]
    for _ in range(steps):
        pending = {operator: iter(row) for operator, row in rows.items()}
        for operator in operators:
            h = next(pending[operator])
            if operator == "drift":
                q = [x + h * v for x, v in zip(q, system.grad_T(p), strict=True)]
            else:
                p = [u - h * f for u, f in zip(p, system.grad_V(q, *constants), strict=True)]
        states.append((q, p))
    return states


def energy_errors(tableau: Tableau, system: System, tau, steps, state=None):
    """|H - H0| / |H0| after 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision."""
    constants = [mpf(parameter.value) for parameter in system.parameters.values()]
    states = trajectory(tableau, system, tau, steps, state)
    start, *energies = [system.T(p) + system.V(q, *constants) for q, p in states]
    return [abs((energy - start) / start) for energy in energies]


class Multiprecision(Number):
    """An mpmath number in a formula, so that a float literal means the decimal that it prints as, as in a kernel."""

    def __init__(self, value):
        self.value = mpf(value)

    @staticmethod
    def _mpf(other):
        return mpf(other.numerator) / other.denominator if isinstance(other, Constant) else other.value

    def _add(self, other):
        return Multiprecision(self.value + self._mpf(other))

    def _multiply(self, other):
        return Multiprecision(self.value * self._mpf(other))

    def _divide(self, other):
        return Multiprecision(self.value / self._mpf(other))

    def __neg__(self):
        return Multiprecision(-self.value)

    def __abs__(self):
        return Multiprecision(abs(self.value))

    def sqrt(self):
        return Multiprecision(sqrt(self.value))

    def lifted(self, number):
        return Multiprecision(self._mpf(number))

    def apply(self, function, *others):
        if function == "cbrt":  # mpmath's of a negative number is complex
            return Multiprecision(mp.sign(self.value) * mp.cbrt(abs(self.value)))
        name = "power" if function == "pow" else function
        return Multiprecision(getattr(mp, name)(self.value, *map(self._mpf, others)))


def value_of(result):
    """The mpmath number that a formula called with :class:`Multiprecision` returns; a constant is one as well."""
    return result.value if isinstance(result, Multiprecision) else Multiprecision._mpf(constant(result))
