"""Energy errors of one run, by a plain loop over the operators of each step in doubles: shares no code with kernels."""

import numpy as np


def largest_error(rows, first, tau, steps, q, p, energy, grad, grad_of_square=None):
    """Largest |dH/H0| over all steps; ``rows`` are kicks, drifts and squares, masses are 1."""
    kicks, drifts, squares = rows
    q, p = np.array(q, dtype=float), np.array(p, dtype=float)
    start, worst = energy(q, p), 0.0

    def kick(i):
        change = -kicks[i] * tau * grad(q)
        if grad_of_square is not None:
            change = change + squares[i] * tau**3 * grad_of_square(q)
        return change

    for _ in range(steps):
        for i in range(len(kicks) if first == "kick" else len(drifts)):
            if first == "kick":
                p = p + kick(i)
                q = q + drifts[i] * tau * p if i < len(drifts) else q
            else:
                q = q + drifts[i] * tau * p
                p = p + kick(i) if i < len(kicks) else p
        worst = max(worst, abs((energy(q, p) - start) / start))
    return worst


def henon_heiles_energy(q, p):
    x, y = q
    return (p @ p + q @ q) / 2 + x * x * y - y**3 / 3


def henon_heiles_gradient(q):
    x, y = q
    return np.array([x + 2 * x * y, y + x * x - y * y])


def henon_heiles_gradient_of_square(q):
    x, y = q
    f = henon_heiles_gradient(q)
    return 2 * np.array([[1 + 2 * y, 2 * x], [2 * x, 1 - 2 * y]]) @ f
