"""Random formulas in every number type against mpmath, with bounds on rounding that follow each operation."""

from __future__ import annotations

from decimal import localcontext

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mpf

from nearharmonic.core import arithmetic
from nearharmonic.core.number import Constant
from nearharmonic.core.tracing import Double, DoubleDouble
from nearharmonic.systems import System
from nearharmonic.systems.gradients import DIGITS, Multiprecision, velocity
from support.methods.function_arguments import compiled
from support.oracles.random_formulas import (
    EVERY,
    EXACT,
    LITERALS,
    NONE,
    OPERATIONS,
    TENTH,
    THREE,
    randomly,
    trees,
    truth,
    written,
)

U = mpf(2) ** -53
#: Relative error of one operation: constant, sum, product, quotient, root. Those of double-doubles: test_arithmetic.py
#: (a root's error is half its square's); a division by a constant is a product with its rounded inverse.
DOUBLE = dict.fromkeys(NONE, U) | {"function": 2 * U}
EXTENDED = {"constant": U**2, "+": 3.1 * U**2, "*": 5 * U**2, "/": 15 * U**2, "root": 4 * U**2}
EXTENDED["function"] = mpf(2) ** -100
#: Python's and numpy's powers are those of the C library, good to one unit in the last place.
LIBRARY = {name: 2 * bound for name, bound in DOUBLE.items()}


def code(tree, kind):
    """The formula in machine code of eight lanes, of columns high, low, high, low; one column is computed alone."""

    def body(x, x_low, y, y_low):
        extended = kind is DoubleDouble
        result = written(tree, (kind(x, x_low), kind(y, y_low)) if extended else (kind(x), kind(y)))
        return result.pair if extended else (result.carrier,)

    return compiled(body, 4, 8, 2 if kind is DoubleDouble else 1)


coordinate = st.floats(0.25, 4).flatmap(lambda x: st.sampled_from([x, -x]))
points = st.tuples(coordinate, coordinate, st.floats(-1, 1), st.floats(-1, 1)).map(
    lambda t: [*arithmetic.two_sum(t[0], t[2] * 2.0**-54), *arithmetic.two_sum(t[1], t[3] * 2.0**-54)]
)


@pytest.mark.slow
@settings(randomly, max_examples=25)
@given(trees(LITERALS + EXACT, functions=False), st.lists(points, min_size=8, max_size=8))
@example(OPERATIONS, [[-0.75, 1e-18, 1.25, -1e-17]] * 8)
@example(("+", ("pow", ("abs", 0), TENTH), ("hypot", ("cbrt", 1), THREE)), [[-0.75, 1e-18, 1.25, -1e-17]] * 8)
def test_machine_code_keeps_the_bounds_of_its_arithmetic(tree, states):
    """Double and double-double, and each lane of eight equals the scalar to the bit; functions: test_functions.py."""
    assume(not isinstance(tree, int))
    exact = [(mpf(a) + mpf(b), mpf(c) + mpf(d)) for a, b, c, d in states]
    heads = [(mpf(a), mpf(c)) for a, _, c, _ in states]
    for kind, bounds, arguments in ((DoubleDouble, EXTENDED, exact), (Double, DOUBLE, heads)):
        expected = [truth(tree, q, bounds) for q in arguments]
        function, columns = code(tree, kind), np.array(states).T
        together = function(columns)
        for k, (value, error) in enumerate(expected):
            single = function(columns[:, k : k + 1])[:, 0]
            assert abs(sum(map(mpf, single)) - value) <= error * (1 + 100 * U)
            assert single.tobytes() == together[:, k].tobytes()


@randomly
@given(trees(LITERALS + EXACT), points)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_multiprecision_agrees_to_its_digits(tree, point):
    """Errors of mpmath at 60 digits, some 1e-60 an operation, dominate those of the 200 digits."""
    value, error = truth(tree, tuple(mpf(x) for x in point[::2]), dict.fromkeys(NONE, mpf(10) ** -59))
    with localcontext(prec=DIGITS):
        result = written(tree, tuple(Multiprecision.of(Constant(x)) for x in point[::2]))
    assert abs(mpf(str(result.value)) - value) <= error


@pytest.mark.slow
@randomly
@given(trees(), points)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_floats_arrays_and_the_written_text_are_the_same_function(tree, point):
    x, y = point[::2]
    value, error = truth(tree, (mpf(x), mpf(y)), LIBRARY)
    made = System(
        name="random", V=lambda q: q[0], grad_V=lambda q: (written(tree, q), 0), q0=("1", "1"), p0=("0", "0"), t_end="1"
    )
    *_, text, zero = velocity(made)(x, y, 0.0, 0.0)
    assert zero == 0
    for result in (written(tree, (x, y)), written(tree, (np.array([x]), np.array([y])))[0], -text):
        assert abs(mpf(float(result)) - value) <= error
