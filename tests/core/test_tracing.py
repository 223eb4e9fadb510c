"""Random formulas in every number type against mpmath, with bounds on rounding that follow each operation."""

from __future__ import annotations

import ctypes
from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from llvmlite import binding, ir
from mpmath import mp, mpf, sqrt

import nearharmonic.math
from nearharmonic.core import arithmetic, number
from nearharmonic.core.native import target_machine
from nearharmonic.core.number import Constant
from nearharmonic.core.physics import Physics
from nearharmonic.core.rules import Rules
from nearharmonic.core.tracing import Double, DoubleDouble, LLVMValue
from nearharmonic.systems import System
from nearharmonic.systems.gradients import Multiprecision
from nearharmonic.systems.source import velocity

U = mpf(2) ** -53
#: Relative error of one operation: constant, sum, product, quotient, root. Those of double-doubles: test_arithmetic.py
#: (a root's error is half its square's); a division by a constant is a product with its rounded inverse.
DOUBLE = {"constant": U, "+": U, "*": U, "/": U, "root": U, "function": 2 * U}
EXTENDED = {"constant": U**2, "+": 3.1 * U**2, "*": 5 * U**2, "/": 15 * U**2, "root": 4 * U**2}
EXTENDED["function"] = mpf(2) ** -100
#: Python's and numpy's powers are those of the C library, good to one unit in the last place.
LIBRARY = {name: 2 * bound for name, bound in DOUBLE.items()}

# A formula is a variable (its number), or (operation, operands...); a constant is its exact decimal and the literal.
LITERALS = [
    ("0.1", 0.1),
    ("-2.5", -2.5),
    ("0.3333333333333333", 1 / 3),
    ("3", 3),
    ("0", 0),
    ("1", 1),
    ("4", 4),
    ("-2", -2),
]
LITERALS += [("0.7", np.float64(0.7)), ("2", np.int64(2))]
EXACT = [("1/3", Fraction(1, 3)), ("2/7", Constant(2, 7)), ("0.1", np.float32(0.1))]
FUNCTIONS = ["sin", "cos", "exp", "log", "cbrt", "tanh", "sinh", "cosh", "erf", "tan"]
EXPONENTS = [2, 3, 4, 5, 7, -1, -2, 1, 0.5, 1.5, -0.5, -1.5, Fraction(5, 2), np.float64(2.0), np.int64(3)]


def trees(literals, functions=True):
    constants = st.sampled_from(literals).map(lambda pair: ("constant", *pair))

    def extended(inner):
        binary = st.sampled_from("+-*/")
        more = [
            st.tuples(st.sampled_from(FUNCTIONS), inner),
            st.tuples(st.sampled_from(["hypot", "atan2", "pow"]), inner, inner),
            st.tuples(st.just("**"), inner, st.sampled_from([0.3, Fraction(-1, 3), 2.7])),
        ]
        return st.one_of(
            *(more if functions else ()),
            st.tuples(binary, inner, inner),
            st.tuples(binary, inner, constants),
            st.tuples(binary, constants, inner),
            st.tuples(st.sampled_from(["neg", "pos", "abs", "sqrt"]), inner),
            st.tuples(st.just("**"), inner, st.sampled_from(EXPONENTS)),
        )

    return st.recursive(st.sampled_from([0, 1]), extended, max_leaves=7)


def formula(tree, q):
    """The formula as a user writes it."""
    if isinstance(tree, int):
        return q[tree]
    name, *operands = tree
    if name == "constant":
        return operands[1]
    if name == "**":
        return formula(operands[0], q) ** operands[1]
    a, *rest = (formula(operand, q) for operand in operands)
    if name in number.FUNCTIONS:
        return getattr(nearharmonic.math, name)(a, *rest)
    unary = {"neg": lambda: -a, "pos": lambda: +a, "abs": lambda: abs(a), "sqrt": lambda: arithmetic.sqrt(a)}
    binary = {"+": lambda: a + rest[0], "-": lambda: a - rest[0], "*": lambda: a * rest[0], "/": lambda: a / rest[0]}
    return (unary | binary)[name]()


def truth(tree, q, bounds):
    """Value in mpmath, and a bound on the error of a computation whose operations have the relative errors ``bounds``.

    Skips the formulas that leave the range in which the bounds hold: roots and divisors at 0, overflow.
    """
    if isinstance(tree, int):
        return q[tree], mpf(0)
    name, *operands = tree
    if name == "constant":
        value = mpf(Fraction(operands[0]).numerator) / Fraction(operands[0]).denominator
        return value, bounds["constant"] * abs(value)
    if name == "**":
        return _power(truth(operands[0], q, bounds), Fraction(str(operands[1])), bounds)
    a, *rest = (truth(operand, q, bounds) for operand in operands)
    if name in number.FUNCTIONS:
        return _function(name, [a, *rest], bounds)
    if not rest:
        return _root(a, bounds) if name == "sqrt" else ({"neg": -a[0], "pos": a[0], "abs": abs(a[0])}[name], a[1])
    (b,) = rest
    return {"+": _sum, "-": _difference, "*": _product, "/": _quotient}[name](a, b, bounds)


def _rounded(value, inherited, bound):
    assume(value == 0 or mpf("1e-30") < abs(value) < mpf("1e30"))
    return value, inherited + bound * (abs(value) + inherited)


def _sum(a, b, bounds):
    return _rounded(a[0] + b[0], a[1] + b[1], bounds["+"])


def _difference(a, b, bounds):
    return _rounded(a[0] - b[0], a[1] + b[1], bounds["+"])


def _product(a, b, bounds):
    return _rounded(a[0] * b[0], abs(a[0]) * b[1] + abs(b[0]) * a[1] + a[1] * b[1], bounds["*"])


def _quotient(a, b, bounds):
    assume(abs(b[0]) > max(mpf("1e-6"), 1000 * b[1]))
    return _rounded(a[0] / b[0], (a[1] + abs(a[0] / b[0]) * b[1]) / (abs(b[0]) - b[1]), bounds["/"])


def _root(a, bounds):
    assume(a[0] > max(mpf("1e-6"), 1000 * a[1]))
    return _rounded(sqrt(a[0]), a[1] / sqrt(a[0] - a[1]), bounds["root"])


def real_root(x):
    return mp.sign(x) * mp.cbrt(abs(x))


def _function(name, operands, bounds):
    """Each operand moves by its error: by the mean value theorem, the value by no more than twice what slopes give.

    That holds if no operand's error, relative to how far the function's slopes change over, reaches a thousandth.
    """
    function = real_root if name == "cbrt" else getattr(mp, "power" if name == "pow" else name)
    values = [x for x, _ in operands]
    assume(all(mpf("1e-3") < abs(x) < 30 and 1000 * error < mpf("1e-6") for x, error in operands))
    assume(name not in ("log", "pow") or values[0] > 0)
    assume(name != "tan" or abs(mp.cos(values[0])) > mpf("0.01"))
    assume(name != "atan2" or values[1] > 0)
    value = function(*values)
    inherited = mpf(0)
    for i, (x, error) in enumerate(operands):
        step = abs(x) * mpf("1e-10")
        ahead, behind = (function(*values[:i], x + sign * step, *values[i + 1 :]) for sign in (1, -1))
        inherited += 2 * error * (abs(ahead - behind) / (2 * step) + abs(value) * mpf("1e-6"))
    return _rounded(value, inherited, bounds["function"])


def _power(a, exponent, bounds):
    if exponent.denominator > 2:
        constant = mpf(exponent.numerator) / exponent.denominator
        return _function("pow", [a, (constant, bounds["constant"] * abs(constant))], bounds)
    if exponent < 0:
        return _quotient((mpf(1), mpf(0)), _power(a, -exponent, bounds), bounds)
    result = None
    for factor in [a] * floor(exponent) + ([_root(a, bounds)] if exponent % 1 else []):
        result = factor if result is None else _product(result, factor, bounds)
    return result


def compiled(tree, kind, lanes):
    """The values of the formula in machine code, for two double-double arguments: rows high, low, high, low."""
    entry = ir.DoubleType() if lanes == 1 else ir.VectorType(ir.DoubleType(), lanes)
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [entry.as_pointer()] * 2), "formula")
    builder = ir.IRBuilder(function.append_basic_block())
    source, target = function.args

    def place(start, i):
        return builder.gep(start, [ir.Constant(ir.IntType(64), i)])

    rows = []
    for i in range(4):
        value = builder.load(place(source, i))
        value.align = 8
        rows.append(LLVMValue(builder, value))
    q = (
        (DoubleDouble(*rows[:2]), DoubleDouble(*rows[2:]))
        if kind is DoubleDouble
        else (Double(rows[0]), Double(rows[2]))
    )
    result = formula(tree, q)
    parts = result.pair if kind is DoubleDouble else (result.carrier,)
    for i, part in enumerate(parts):
        builder.store(part.value, place(target, i)).align = 8
    builder.ret_void()
    machine = target_machine()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(str(module)), machine)
    engine.finalize_object()
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(engine.get_function_address("formula"))

    def run(values):
        arguments = np.ascontiguousarray(values, dtype=float)
        results = np.zeros((2, lanes))
        call(arguments.ctypes.data, results.ctypes.data)
        return results

    run.engine = engine  # code lives as long as its engine
    return run


coordinate = st.floats(0.25, 4).flatmap(lambda x: st.sampled_from([x, -x]))
points = st.tuples(coordinate, coordinate, st.floats(-1, 1), st.floats(-1, 1)).map(
    lambda t: [*arithmetic.two_sum(t[0], t[2] * 2.0**-54), *arithmetic.two_sum(t[1], t[3] * 2.0**-54)]
)
TENTH, THREE, ZERO = ("constant", "0.1", 0.1), ("constant", "3", 3), ("constant", "0", 0)
#: Every operation with each order of its operands; the random formulas nest them.
EVERY = (
    "+",
    ("+", ("*", TENTH, ("**", ("abs", 0), -1.5)), ("/", ("sqrt", ("**", 1, 6)), ("pos", 0))),
    ("-", ("-", THREE, ("/", 0, THREE)), ("+", ("/", TENTH, ("neg", 1)), ("-", ("+", ("*", 0, 1), ZERO), TENTH))),
)
randomly = settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])


@settings(randomly, max_examples=25)
@given(trees(LITERALS + EXACT), st.lists(points, min_size=8, max_size=8))
@example(EVERY, [[-0.75, 1e-18, 1.25, -1e-17]] * 8)
def test_machine_code_keeps_the_bounds_of_its_arithmetic(tree, states):
    """Double and double-double, and each lane of eight equals the scalar to the bit."""
    assume(not isinstance(tree, int))
    exact = [(mpf(a) + mpf(b), mpf(c) + mpf(d)) for a, b, c, d in states]
    heads = [(mpf(a), mpf(c)) for a, _, c, _ in states]
    for kind, bounds, arguments in ((DoubleDouble, EXTENDED, exact), (Double, DOUBLE, heads)):
        expected = [truth(tree, q, bounds) for q in arguments]
        scalar, lanes = (compiled(tree, kind, n) for n in (1, 8))
        together = lanes(np.array(states).T)
        for k, (state, (value, error)) in enumerate(zip(states, expected, strict=True)):
            single = scalar(np.array(state)[:, None])[:, 0]
            assert abs(mpf(single[0]) + mpf(single[1]) - value) <= error * (1 + 100 * U)
            assert single.tobytes() == together[:, k].tobytes()


@randomly
@given(trees(LITERALS + EXACT), points)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_multiprecision_agrees_to_its_digits(tree, point):
    """Errors of mpmath at 60 digits, some 1e-60 an operation, dominate those of the 200 digits."""
    value, error = truth(tree, tuple(mpf(x) for x in point[::2]), dict.fromkeys(DOUBLE, mpf(10) ** -59))
    result = formula(tree, tuple(Multiprecision.of(Constant(x)) for x in point[::2]))
    assert abs(mpf(str(result.value)) - value) <= error


@randomly
@given(trees(LITERALS), points)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_floats_arrays_and_the_written_text_are_the_same_function(tree, point):
    x, y = point[::2]
    value, error = truth(tree, (mpf(x), mpf(y)), LIBRARY)
    made = System(
        name="random", label="random", V=lambda q: q[0], grad_V=lambda q: (formula(tree, q), 0), q0=("1", "1"),
        p0=("0", "0"), t_end="1", units=dict.fromkeys(("q", "p", "t", "energy"), "1"), source="test",
    )  # fmt: skip
    *_, written, zero = velocity(made)(x, y, 0.0, 0.0)
    assert zero == 0
    for result in (formula(tree, (x, y)), formula(tree, (np.array([x]), np.array([y])))[0], -written):
        assert abs(mpf(float(result)) - value) <= error


RATIONAL = trees(
    functions=False,
    literals=[("0.1", 0.1), ("-2.5", -2.5), ("3", np.int64(3)), ("1/3", Fraction(1, 3)), ("0.7", np.float64(0.7))],
)


def rational(tree, q):
    """The same formula by the rules of fractions; None where it has a root."""
    if isinstance(tree, int):
        return q[tree]
    name, *operands = tree
    if name == "constant":
        return Fraction(operands[0])
    exponent = Fraction(str(operands[1])) if name == "**" else 1
    assume(name != "sqrt" and exponent.denominator == 1)
    values = [rational(operand, q) for operand in operands[: 1 if name == "**" else 2]]
    assume(name not in ("/", "**") or values[-1] != 0)
    if name == "**":
        return values[0] ** int(exponent)
    if len(values) == 1:
        return {"neg": -values[0], "pos": values[0], "abs": abs(values[0])}[name]
    a, b = values
    return a / b if name == "/" else {"+": a + b, "-": a - b, "*": a * b}[name]


@randomly
@given(RATIONAL, st.fractions(-3, 3, max_denominator=9), st.fractions(-3, 3, max_denominator=9))
def test_constants_are_exact_through_a_whole_formula(tree, x, y):
    expected = rational(tree, (x, y))
    assert formula(tree, (Constant(x), Constant(y))) == expected


@pytest.mark.parametrize("extended", [False, True])
def test_a_constant_component_and_energy_are_numbers_of_the_kernel(extended):
    """One tenth as a pair: 0.1 and what is missing from it, 0.1 - 0.1000000000000000055511151231257827."""
    physics = Physics(
        name="constant", V=lambda q: 0.1, grad_V=lambda q: (0, 0.1), T=lambda p: Fraction(1, 5), grad_T=lambda p: p,
        parameters=0, constants=(), dimension=2, grad_V_and_V=None, balanced_T=None,
    )  # fmt: skip
    rules = Rules(physics, extended=extended, compensated=True)
    builder = ir.IRBuilder(ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), []), "f").append_basic_block())
    state = [LLVMValue(builder, ir.Constant(ir.DoubleType(), float(i))) for i in range(8)]
    rest = float(Fraction(1, 10) - Fraction(0.1))
    force = [entry.value.constant for entry in rules.force(state, [])]
    assert force == ([0.0, 0.1, 0.0, rest] if extended else [0.0, 0.1])
    high, low = (half.value.constant for half in rules.energies(state, [])[:2])
    assert Fraction(high) + Fraction(low) == pytest.approx(0.3, rel=1e-30)
    assert low == float(Fraction(3, 10) - Fraction(0.3))


def test_powers_up_to_four_multiply_one_factor_after_the_other():
    """Bits of formulas that are in use; the README's x**4 among them."""
    x = 1.1
    carrier = DoubleDouble(x, 0.0)
    chain = carrier
    for exponent in (2, 3, 4):
        chain = chain * carrier
        assert (carrier**exponent).pair == chain.pair
