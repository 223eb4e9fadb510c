"""Potentials of numba that several tests use, and systems of them."""

import numba
import numpy as np

import nearharmonic as nh


@numba.njit
def spring(q, k):
    return k * q[0] * q[0] / 2


@numba.njit
def spring_force(q, k):
    return (k * q[0],)


def springs(**changes):
    """An oscillator of frequency sqrt(k)."""
    given = {"V": spring, "grad_V": spring_force, "q0": 1, "p0": 0, "t_end": 20, "parameters": {"k": 1}}
    return nh.System(**({"name": "spring"} | given | changes))


def walled(heights):
    """V and grad_V with a table in their closure, memory of their own, and an exception beyond |q| = 2."""
    table = np.array(heights)

    @numba.njit
    def height(x):
        if abs(x) > 2:
            raise ValueError("beyond the walls")
        terms = np.zeros(3)
        for i in range(3):
            terms[i] = table[i] * x ** (i + 2)
        return terms.sum()

    @numba.njit
    def V(q):
        return height(q[0])

    @numba.njit
    def grad_V(q):
        x = q[0]
        return np.array([2 * table[0] * x + 3 * table[1] * x**2 + 4 * table[2] * x**3])

    return V, grad_V


def polynomial(q):
    """The potential of ``walled([0.5, 0.1, 0.25])`` as a formula."""
    return q[0] ** 2 / 2 + q[0] ** 3 / 10 + q[0] ** 4 / 4
