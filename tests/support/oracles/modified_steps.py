"""Steps with kicks of a modified potential in mpmath, with gradients written out by hand: shares no code with kernels.

A potential is (masses, V', grad |V'|^2, V), functions of q and t in mpmath; |V'|^2 is the square by inverse masses.
"""

from __future__ import annotations

from mpmath import cos, mpf, sin, sqrt


def henon_heiles(q, _):
    x, y = q
    f = x + 2 * x * y, y + x * x - y * y
    return f, (
        2 * ((1 + 2 * y) * f[0] + 2 * x * f[1]),
        2 * (2 * x * f[0] + (1 - 2 * y) * f[1]),
    )


def kepler(GM):
    def rates(q, _):
        r = sqrt(q[0] ** 2 + q[1] ** 2)
        return tuple(GM * x / r**3 for x in q), tuple(-4 * GM**2 * x / r**6 for x in q)  # |V'|^2 = GM^2 / r^4

    return rates


def spring(masses, stiffness):
    """V = k (q0 - q1)^2 / 2 + q0^4."""

    def rates(q, _):
        pull = stiffness * (q[0] - q[1])
        f = pull + 4 * q[0] ** 3, -pull
        a, b = f[0] / masses[0], f[1] / masses[1]
        return f, (2 * ((stiffness + 12 * q[0] ** 2) * a - stiffness * b), 2 * stiffness * (b - a))

    return rates


def driven_pendulum(q, t):
    """V = -cos q - q cos(t) / 10."""
    f = sin(q[0]) - cos(t) / 10
    return (f,), (2 * cos(q[0]) * f,)


def operators_of(step, tau):
    """The operators of a step in their order: (kick, square) pairs and drifts, times powers of tau."""
    kicks = [(mpf(k) * tau, mpf(m) * tau**3) for k, m in zip(step.kick, step.square, strict=True)]
    drifts = [mpf(c) * tau for c in step.drift]
    rows = (kicks, drifts) if step.first == "kick" else (drifts, kicks)
    return [row[i] for i in range(len(rows[0])) for row in rows if i < len(row)]


def states(tableau, rates, q, p, tau, steps, masses=None):
    """States (q, p) after 0, 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision.

    Those of a processed method are processed, each by itself.
    """
    masses = [mpf(1)] * len(q) if masses is None else masses

    def moved(state, operators):
        q, p, t = state
        for operator in operators:
            if isinstance(operator, tuple):
                f, g = rates(q, t)
                p = [x - operator[0] * a + operator[1] * b for x, a, b in zip(p, f, g, strict=True)]
            else:
                q = [x + operator * v / m for x, v, m in zip(q, p, masses, strict=True)]
                t += operator
        return q, p, t

    behind = operators_of(tableau.processor, tau) if tableau.processed else []
    negated = [tuple(-x for x in operator) if isinstance(operator, tuple) else -operator for operator in behind]
    state = moved(([mpf(x) for x in q], [mpf(x) for x in p], mpf(0)), reversed(negated))
    found = [state]
    for _ in range(steps):
        found.append(moved(found[-1], operators_of(tableau, tau)))
    return [moved(state, behind)[:2] for state in found]
