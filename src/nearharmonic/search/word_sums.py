"""Kernels: sums over the words of a step, in doubles, with derivatives, and the residuals of equations made of them.

``table`` is a :class:`~nearharmonic.search.nystrom_equations.WordTable` as its arrays (parent, letter); a step comes as
``letters`` and coefficients ``c`` of its operators. exp(c X) behind a product adds c^k/k! S(v) to S(w) for w = v X^k.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nearharmonic.core.cache import strict

#: (table, letters, directions, offset, weights, wanted): table and operators, the coefficients as ``directions``
#: (operator, unknown) x + ``offset`` (operator), and equations ``weights`` (equation, word) S = ``wanted`` (equation).
System = tuple[Any, ...]


@strict
def word_sums(table: Any, letters: Any, c: Any) -> Any:
    """S(w) of all words."""
    parent, letter = table
    sums = np.zeros(len(parent))
    sums[0] = 1.0
    for i in range(len(letters)):
        # Longer words first: what they draw on is still that of the product so far.
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                sums[w] += factor * sums[v]
                while letter[v] == letters[i]:
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
                    sums[w] += factor * sums[v]
    return sums


@strict
def word_sums_and_slopes(table: Any, letters: Any, c: Any, directions: Any) -> Any:
    """S(w), and its derivatives (word, unknown), ``directions`` being those of ``c``."""
    parent, letter = table
    sums, slopes = np.zeros(len(parent)), np.zeros((len(parent), directions.shape[1]))
    sums[0] = 1.0
    for i in range(len(letters)):
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                while True:
                    sums[w] += factor * sums[v]
                    for u in range(directions.shape[1]):
                        slopes[w, u] += factor * slopes[v, u]
                    if letter[v] != letters[i]:
                        break
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
        # d exp(c X) = exp(c X) X dc: the sums are those behind the operator by now.
        for w in range(1, len(parent)):
            if letter[w] == letters[i]:
                for u in range(directions.shape[1]):
                    slopes[w, u] += directions[i, u] * sums[parent[w]]
    return sums, slopes


@strict
def coefficients(directions: Any, offset: Any, x: Any) -> Any:
    """The coefficients of a step from its unknowns."""
    c = offset.copy()
    for i in range(len(c)):
        for u in range(len(x)):
            c[i] += directions[i, u] * x[u]
    return c


@strict
def residuals(system: Any, x: Any) -> Any:
    """The equations' residuals at ``x`` (unknown), their derivatives (equation, unknown), and the residuals' norm."""
    table, letters, directions, offset, weights, wanted = system
    sums, slopes = word_sums_and_slopes(table, letters, coefficients(directions, offset, x), directions)
    F, J = -wanted, np.zeros((len(wanted), len(x)))
    for e in range(len(wanted)):
        for w in range(len(sums)):
            if weights[e, w] != 0.0:
                F[e] += weights[e, w] * sums[w]
                for u in range(len(x)):
                    J[e, u] += weights[e, w] * slopes[w, u]
    return F, J, np.sqrt(np.sum(F * F))


@strict
def smallest_step(F: Any, J: Any, damping: Any) -> Any:
    """J^T (J J^T + damping)^-1 F, of all steps the shortest; nan if that inverse does not exist."""
    m, n = J.shape
    normal, step = np.zeros((m, m)), np.zeros(n)
    for i in range(m):
        for j in range(i + 1):
            for u in range(n):
                normal[i, j] += J[i, u] * J[j, u]
        normal[i, i] += damping
    y = cholesky_solved(normal, F.copy())
    for u in range(n):
        for i in range(m):
            step[u] += J[i, u] * y[i]
    return step


@strict
def cholesky_solved(L: Any, y: Any) -> Any:
    """The solution of a positive system with lower triangle ``L`` and right-hand side ``y``; both are overwritten."""
    m = len(y)
    for j in range(m):
        for k in range(j):
            L[j, j] -= L[j, k] * L[j, k]
        L[j, j] = np.sqrt(L[j, j]) if L[j, j] > 0.0 else np.nan
        for i in range(j + 1, m):
            for k in range(j):
                L[i, j] -= L[i, k] * L[j, k]
            L[i, j] /= L[j, j]
    for i in range(m):
        for k in range(i):
            y[i] -= L[i, k] * y[k]
        y[i] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            y[i] -= L[k, i] * y[k]
        y[i] /= L[i, i]
    return y
