"""The language of loops: what is written computes what Python computes with the same function."""

from inspect import signature
from math import inf, isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llvmlite import ir

from nearharmonic.core.arithmetic import dd_add, dd_mul, fma
from nearharmonic.core.kernel import linked_code
from nearharmonic.core.layout import Signature, floats, integers
from nearharmonic.core.native import loaded
from nearharmonic.core.reals import Writer, written
from nearharmonic.core.values import Kinds

ONE = Signature((floats("a", "n"), integers("k", "m"), floats("x")), result="float64")
#: No such place is in the memory of a process.
FAR = 2**60
TINY = 2.0**-60


def collatz(n, a, k):
    """An inner loop with ``continue``, and conditions of two parts that are asked for in order."""
    steps, odd, i = 0, 0, 0
    while i < n and a[i] > 0:
        number = int(a[i])
        while number != 1:
            steps += 1
            if number % 2 == 0:
                number = number // 2
                continue
            number = 3 * number + 1
            odd += 1
        k[i] = odd
        i += 1
    return steps + 0.5 * odd


def first_above(n, a, x):
    """A result from the middle of two loops, behind which is another."""
    for i in range(n):
        for j in range(i, n, 2):
            if a[i] + a[j] > x:
                return 100.0 * i + j
            if j > i + 4:
                break
    return -1.0


def guarded(n, a, x):
    """What is not asked for is not read."""
    found = a[FAR] if n > 1000 else x
    if n > 1000 and a[FAR] > 0:
        found = inf
    if not (n < 1000 or a[FAR] > 0):
        found = -inf
    return found


def swapped(n, a, x):
    """Tuples, of which variables are replaced together; the largest and the smallest of integers; |x|; NaN."""
    state, turns = (x, (1.0, a[0])), 0
    for i in range(min(n, 5)):
        y, (low, high) = state
        state = (high, (y, abs(low) - (a[i] if a[i] < 2 else 2.0)))
        turns = max(turns, 3 - i)
    last = state[-1][1]
    return (-turns + 1 if isnan(last) else turns) + last


def pairs(n, a, x):
    """Double-doubles, and sums into an array."""
    total = a[0], 0.0
    for i in range(1, n):
        total = dd_add(total, dd_mul((a[i], 0.0), (x, a[i] * TINY)))
        a[i] += fma(total[1], x, -total[0])
    return total[0] + total[1]


def compiled(function):
    return loaded(*linked_code(written(function, ONE, Kinds(1, 1, 1))), ONE)


FUNCTIONS = {function: compiled(function) for function in (collatz, first_above, guarded, swapped, pairs)}
moderate = st.integers(-3, 40)
wild = moderate | st.sampled_from([0.1, -0.0, 1e300, nan])
#: What functions take that leave the range of integers, or of a product in exact arithmetic.
TAKEN = dict.fromkeys((collatz, pairs), moderate)


@pytest.mark.parametrize("function", FUNCTIONS)
@given(st.data())
def test_written_functions_compute_what_python_does(function, data):
    numbers = TAKEN.get(function, wild)
    entries, x = data.draw(st.lists(numbers, min_size=6, max_size=9)), float(data.draw(numbers))
    a, k = np.array(entries, float), np.zeros(len(entries), np.int64)
    given = {"n": len(entries), "a": a.tolist(), "k": k.tolist(), "x": x}
    found = FUNCTIONS[function](a, k, x)
    expected = function(*(given[name] for name in signature(function).parameters))
    assert np.array_equal([found, *a, *k], [expected, *given["a"], *given["k"]], equal_nan=True)


def test_what_the_language_lacks_is_named():
    with pytest.raises(TypeError, match=r"'\[1.0, x\]': the language of loops has no List"):
        written(lambda x: [1.0, x], ONE, Kinds(1, 1, 1))


def test_a_variable_keeps_its_kind():
    def mixed(n, x):
        for i in range(n):
            n = x + i
        return n

    with pytest.raises(TypeError, match="a number of kind D is none of kind I"):
        written(mixed, ONE, Kinds(1, 1, 1))


def test_a_counter_is_unknown_behind_its_loop():
    """Python's is one step less than the one that ended the loop."""

    def behind(n):
        for i in range(n):
            n += i
        return 1.0 * i

    with pytest.raises(AttributeError, match="'i'"):
        written(behind, ONE, Kinds(1, 1, 1))


def test_what_is_known_while_writing_is_not_asked_at_run_time():
    plain, branching = (
        str(written(function, ONE, Kinds(1, 1, 1)))
        for function in (lambda x: x if inf > 1 else -x, lambda n, x: x if n > 1 else -x)
    )
    assert "br " not in plain
    assert "br " in branching
    builder = ir.IRBuilder(ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), []), "f").append_basic_block())
    assert Writer(builder, Kinds(1, 1, 1)).inlined(lambda x: (x + 1) % 3, [4]) == 2
