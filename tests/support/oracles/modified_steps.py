"""Steps with kicks of a modified potential in mpmath, with gradients written out by hand: shares no code with kernels.

A potential is (masses, V', grad |V'|^2, V), functions of q and t in mpmath; |V'|^2 is the square by inverse masses.
"""

from mpmath import cos, mpf, sin, sqrt

from support.oracles.multiprecision import applied, states_of
from support.oracles.word_series import operators_of


def henon_heiles(q, _):
    x, y = q
    f = x + 2 * x * y, y + x * x - y * y
    return f, (2 * ((1 + 2 * y) * f[0] + 2 * x * f[1]), 2 * (2 * x * f[0] + (1 - 2 * y) * f[1]))


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


def states(tableau, rates, q, p, tau, steps, masses=None):
    """States (q, p) after 0, 1, ..., ``steps`` steps of ``tau``, in mpmath's current precision.

    Those of a processed method are processed, each by itself.
    """
    masses = [mpf(1)] * len(q) if masses is None else masses

    def moved(row, h, slopes):
        return [x + h * slope for x, slope in zip(row, slopes, strict=True)]

    flows = {
        "A": lambda h, q, p, t: (moved(q, h, [v / m for v, m in zip(p, masses, strict=True)]), p, t + h),
        "B": lambda h, q, p, t: (q, moved(p, -h, rates(q, t)[0]), t),
        "C": lambda h, q, p, t: (q, moved(p, h, rates(q, t)[1]), t),
    }
    start = [mpf(x) for x in q], [mpf(x) for x in p], mpf(0)
    if not tableau.processed:
        return [state[:2] for state in states_of(tableau, flows, start, tau, steps)]
    for letter, c in reversed(operators_of(tableau.processor, mpf)):
        start = flows[letter](-c * tau ** (3 if letter == "C" else 1), *start)
    found = states_of(tableau, flows, start, tau, steps)
    return [applied(tableau.processor, flows, state, tau)[:2] for state in found]
