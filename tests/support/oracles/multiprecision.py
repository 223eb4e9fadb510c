"""Steps in mpmath, one flow after the other: they share no code with the kernels, and read the same strings."""

from __future__ import annotations

from mpmath import mpf, sqrt

from nearharmonic.core.number import Constant, Number, constant
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import System
from support.oracles.random_formulas import mpmaths
from support.oracles.word_series import operators_of


def digits_of(run, name, sample=-1):
    """The components of a sample with the digits below the doubles, where the run has them."""
    low = run[f"{name}_low"][sample] if f"{name}_low" in run else 0 * run[name][sample]
    return [mpf(float(x)) + mpf(float(y)) for x, y in zip(run[name][sample], low, strict=True)]


def applied(step, flows, state, tau):
    """The state after one step; a flow (h, *state) -> state of each letter takes its coefficient times tau or tau^3."""
    for letter, c in operators_of(step, mpf):
        state = flows[letter](c * tau ** (3 if letter == "C" else 1), *state)
    return state


def drift(velocity):
    return lambda h, q, p: ([x + h * v for x, v in zip(q, velocity(p), strict=True)], p)


def kick(force):
    return lambda h, q, p: (q, [u - h * f for u, f in zip(p, force(q), strict=True)])


def states_of(step, flows, start, tau, steps):
    """States after 0, 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision."""
    found = [start]
    for _ in range(steps):
        found.append(applied(step, flows, found[-1], tau))
    return found


def trajectory(tableau: Tableau, system: System, tau, steps, state=None):
    """States (q, p) after 0, 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision."""
    constants = [mpf(parameter.value) for parameter in system.parameters.values()]
    flows = {"A": drift(system.grad_T), "B": kick(lambda q: system.grad_V(q, *constants))}
    start = state or ([mpf(x) for x in system.q0], [mpf(x) for x in system.p0])
    return states_of(tableau, flows, start, tau, steps)


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
        return Multiprecision(mpmaths(function)(self.value, *map(self._mpf, others)))


def value_of(result):
    """The mpmath number that a formula called with :class:`Multiprecision` returns; a constant is one as well."""
    return result.value if isinstance(result, Multiprecision) else Multiprecision._mpf(constant(result))
