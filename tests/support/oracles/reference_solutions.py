"""Reference solutions that share no code with the package: matrices and Kepler's equation in mpmath."""

from mpmath import cos, eye, findroot, matrix, mpf, pi, sin, sqrt

from support.oracles.word_series import operators_of


def oscillator_step(tableau, tau):
    """The 2x2 matrix of one step on H = (p^2 + q^2)/2 from the tableau's own decimal strings.

    V = q^2/2 has |V'|^2 = q^2, whose gradient is 2 q.
    """
    step = eye(2)
    for letter, c in operators_of(tableau, mpf):
        entry = {"A": c * tau, "B": -c * tau, "C": 2 * c * tau**3}[letter]
        step = matrix([[1, entry], [0, 1]] if letter == "A" else [[1, 0], [entry, 1]]) * step
    return step


def ellipse_error(tableau, tau):
    """max |H/H0 - 1| on the ellipse that the steps from (1, 0) conserve."""
    step = oscillator_step(tableau, tau)
    return abs(step[1, 0] / step[0, 1] + 1)


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
    return (-a * (cos(anomaly) - e), -b * sin(anomaly), a * sin(anomaly) * rate, -b * cos(anomaly) * rate)
