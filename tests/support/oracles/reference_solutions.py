"""Reference solutions that share no code with the package: matrices and Kepler's equation in mpmath."""

from __future__ import annotations

from mpmath import cos, eye, findroot, matrix, mpf, pi, sin, sqrt


def oscillator_step(tableau, tau):
    """The 2x2 matrix of one step on H = (p^2 + q^2)/2 from the tableau's own decimal strings."""
    rows = {
        "drift": [matrix([[1, mpf(c) * tau], [0, 1]]) for c in tableau.drift],
        "kick": [matrix([[1, 0], [-mpf(c) * tau, 1]]) for c in tableau.kick],
    }
    other = "kick" if tableau.first == "drift" else "drift"
    step = eye(2)
    for i in range(tableau.stages + 1):
        step = rows[tableau.first][i] * step
        if i < tableau.stages:
            step = rows[other][i] * step
    return step


def oscillator_state(tableau, tau, steps):
    """(q, p) after ``steps`` steps from (1, 0), by binary powers of the step matrix."""
    state = oscillator_step(tableau, tau) ** steps * matrix([1, 0])
    return state[0], state[1]


def kepler_state(aphelion, slowest, GM, t):
    """(x, y, u, v) at time t on the orbit that starts at aphelion on the x axis, from Kepler's equation."""
    r, v, GM, t = map(mpf, (aphelion, slowest, GM, t))
    a = 1 / (2 / r - v * v / GM)
    e = r / a - 1
    mean = pi + sqrt(GM / a**3) * t
    anomaly = findroot(lambda E: E - e * sin(E) - mean, mean + e * sin(mean))
    b, rate = a * sqrt(1 - e * e), sqrt(GM / a**3) / (1 - e * cos(anomaly))
    # The perihelion lies on the negative x axis: the textbook ellipse turned by half a turn.
    return (
        -a * (cos(anomaly) - e),
        -b * sin(anomaly),
        a * sin(anomaly) * rate,
        -b * cos(anomaly) * rate,
    )
