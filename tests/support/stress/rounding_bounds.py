"""Runs in mpmath, substep by substep, with a bound of the rounding errors of the same run in floating point.

It shares no code with the package: the formulas are written out below, and a method is its rows of decimal strings.

A substep adds h f to one half of the state, f a sum of terms. In floating point with unit roundoff u, the sum is off by
at most ``ROUNDINGS`` u times the sum of |h term|: for rounded coefficients, for the operations of a term, and for the
rounded argument of f, whose terms grow at most as the eighth power of it. The addition is off by u |state| if the
summation is plain, else by u^2 |state|. Each of these errors is carried on to the later steps by the tangent map, which
is the difference of neighbouring runs in mpmath.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import zip_longest

import mpmath
import numpy as np
from mpmath import mpf

DIGITS = 60
#: Roundings of a term: 8 operations, its coefficient and 4 for the argument; twice that for terms of second order.
ROUNDINGS = 32
#: Displacement of neighbouring runs, relative to the size of the state.
DISPLACEMENT = mpf(2) ** -90
#: Bound of a state's error, relative to the state, up to which errors grow by the tangent map.
LINEAR = 1e-5
#: Unit roundoff of moves and of sums, by precision and summation. A double-double operation is good to 5 * 2^-106.
UNITS = {
    ("double", "plain"): (2.0**-53, 2.0**-53), ("double", "compensated"): (2.0**-53, 2.0**-104),
    ("extended", "plain"): (2.0**-103, 2.0**-103), ("extended", "compensated"): (2.0**-103, 2.0**-103),
}  # fmt: skip
Terms = list[list[mpf]]


@dataclass(frozen=True)
class Formulas:
    """Terms of each component of grad V, of grad |grad V|^2 and of grad T, and of the energy."""

    force: Callable[[list[mpf]], Terms]
    energy: Callable[[list[mpf], list[mpf]], list[mpf]]
    square: Callable[[list[mpf]], Terms] | None = None
    velocity: Callable[[list[mpf]], Terms] = lambda p: [[u] for u in p]
    limit: float = 1.0


def _henon_heiles_square(q):
    x, y = q
    return [[2 * x, 12 * x * y, 4 * x**3, 4 * x * y * y], [2 * y, 6 * x * x, -6 * y * y, 4 * y**3, 4 * x * x * y]]


def _kepler(power, factor):
    """Terms of ``factor`` q / |q|^power."""
    return lambda q: [[factor * x / mpmath.sqrt(q[0] ** 2 + q[1] ** 2) ** power] for x in q]


def formulas(system: str, limit: float) -> Formulas:
    """Formulas of a registered system."""
    GM = mpf("1.71994752")
    found = {
        "sho": Formulas(
            force=lambda q: [[q[0]]],
            square=lambda q: [[2 * q[0]]],
            energy=lambda q, p: [p[0] ** 2 / 2, q[0] ** 2 / 2],
        ),
        "henon_heiles": Formulas(
            force=lambda q: [[q[0], 2 * q[0] * q[1]], [q[1], q[0] ** 2, -(q[1] ** 2)]],
            square=_henon_heiles_square,
            energy=lambda q, p: [*(u * u / 2 for u in (*p, *q)), q[0] ** 2 * q[1], -(q[1] ** 3) / 3],
        ),
        "kepler": Formulas(
            force=_kepler(3, GM),
            square=_kepler(6, -4 * GM**2),
            energy=lambda q, p: [*(u * u / 2 for u in p), -GM / mpmath.sqrt(q[0] ** 2 + q[1] ** 2)],
        ),
        "relativistic_oscillator": Formulas(
            force=lambda q: [[q[0]]],
            velocity=lambda p: [[p[0] / mpmath.sqrt(1 + p[0] ** 2)]],
            energy=lambda q, p: [p[0] ** 2 / (1 + mpmath.sqrt(1 + p[0] ** 2)), q[0] ** 2 / 2],
        ),
    }[system]  # fmt: skip
    return Formulas(found.force, found.energy, found.square, found.velocity, limit)


def substeps(method, tau: mpf) -> list[tuple[str, mpf, mpf]]:
    """Operators of one step in their order: kicks with their squares, and drifts."""
    squares = method.square or ("0",) * len(method.kick)
    kicks = [("kick", mpf(a) * tau, mpf(m) * tau**3) for a, m in zip(method.kick, squares, strict=True)]
    drifts = [("drift", mpf(b) * tau, mpf(0)) for b in method.drift]
    pair = (kicks, drifts) if method.first == "kick" else (drifts, kicks)
    return [one for both in zip_longest(*pair) for one in both if one is not None]


def _moved(given: Formulas, state, substep):
    """State after a substep, and the sum of the moduli of what it adds to each component."""
    (q, p), (operator, h, m) = state, substep
    if operator == "drift":
        terms = [[h * term for term in component] for component in given.velocity(p)]
        after = [x + sum(component) for x, component in zip(q, terms, strict=True)], p
    else:
        terms = [[-h * term for term in component] for component in given.force(q)]
        if m:
            terms = [a + [m * term for term in b] for a, b in zip(terms, given.square(q), strict=True)]
        after = q, [u + sum(component) for u, component in zip(p, terms, strict=True)]
    sizes = [float(sum(map(abs, component))) for component in terms]
    still = [0.0] * len(q)
    return after, sizes + still if operator == "drift" else still + sizes


@dataclass
class BoundedRun:
    """States of a run (q + p) after each step, relative energy errors, and bounds of what rounding adds to each.

    It ends with the step whose energy error is above the limit for certain, and with the first whose bounds say nothing
    (``lost``): the errors would no longer grow by the tangent map.
    """

    states: list[list[mpf]]
    bounds: list[np.ndarray]
    errors: list[mpf]
    error_bounds: list[float]
    lost: bool = False


def bounded_run(
    method, given: Formulas, start, tau: Fraction, steps: int, precision: str, summation: str
) -> BoundedRun:
    """Integrate ``steps`` steps of a method from ``start``, (q, p) as decimal strings."""
    with mpmath.workdps(DIGITS), np.errstate(all="ignore"):
        return _Integration(method, given, start, tau, UNITS[precision, summation]).run(steps)


class _Integration:
    def __init__(self, method, given, start, tau, units):
        self.given, self.units = given, units
        self.substeps = substeps(method, mpf(tau.numerator) / tau.denominator)
        q, p = ([mpf(x) for x in half] for half in start)
        self.d = len(q)
        self.sizes = [max(map(abs, half)) or mpf(1) for half in (q, p) for _ in half]
        self.runs = [(q, p)]
        for k in range(2 * self.d):
            moved = [*q, *p]
            moved[k] += DISPLACEMENT * self.sizes[k]
            self.runs.append((moved[: self.d], moved[self.d :]))
        eye = np.eye(self.d)
        self.omega = np.block([[0 * eye, eye], [-eye, 0 * eye]])
        start_size = np.array([float(abs(x)) for x in (*q, *p)])
        self.inverses, self.sources = [np.eye(2 * self.d)], [units[1] * start_size]

    def tangent(self):
        base = [x for half in self.runs[0] for x in half]
        columns = [
            [float((x - y) / (DISPLACEMENT * size)) for x, y in zip((*q, *p), base, strict=True)]
            for (q, p), size in zip(self.runs[1:], self.sizes, strict=True)
        ]
        return np.array(columns).T

    def step(self):
        for substep in self.substeps:
            moved = [_moved(self.given, state, substep) for state in self.runs]
            self.runs = [state for state, _ in moved]
            sizes, state = np.array(moved[0][1]), np.array([float(abs(x)) for half in self.runs[0] for x in half])
            # The inverse of a symplectic matrix J is -Omega J^T Omega.
            self.inverses.append(-self.omega @ self.tangent().T @ self.omega)
            self.sources.append(ROUNDINGS * self.units[0] * sizes + self.units[1] * state * (sizes > 0))

    def run(self, steps):
        energy = self.given.energy
        first = energy(*self.runs[0])
        H0 = mpmath.fsum(first)
        unit = abs(H0) or mpf(1)
        found = BoundedRun([[x for half in self.runs[0] for x in half]], [2 * self.sources[0]], [mpf(0)], [0.0])
        for _ in range(steps):
            self.step()
            q, p = self.runs[0]
            grown = self.tangent() @ np.array(self.inverses)
            bound = (np.abs(grown) @ np.array(self.sources)[:, :, None]).sum(axis=0)[:, 0]
            slope = np.array([float(mpmath.fsum(terms)) for terms in (*self.given.force(q), *self.given.velocity(p))])
            off = (np.abs(slope @ grown) * np.array(self.sources)).sum()
            terms = energy(q, p)
            size = float(mpmath.fsum(map(abs, (*terms, *first))))
            found.states.append([*q, *p])
            found.bounds.append(bound)
            found.errors.append((mpmath.fsum(terms) - H0) / unit)
            found.error_bounds.append(float((off + ROUNDINGS * self.units[0] * size) / unit))
            certain = abs(found.errors[-1]) - found.error_bounds[-1] > self.given.limit
            whole = np.array([float(max(map(abs, half))) for half in (q, p) for _ in half])
            found.lost = not (bound < LINEAR * whole).all()
            if certain or found.lost:
                break
        return found
