"""Short forms of declarations of a system, and their meanings."""

from __future__ import annotations

import copy
import math
import operator
import pickle
import re
from dataclasses import replace
from fractions import Fraction
from functools import partial, wraps
from math import cos
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core.emission import fingerprint
from nearharmonic.core.number import Constant
from nearharmonic.core.tracing import Physics, Rules
from nearharmonic.errors import NearharmonicError, SystemDefinitionError
from nearharmonic.systems.gradients import velocity_text
from support.methods.own_systems import spring


def square(q, p, k):
    return q[0] ** 2


def test_parameter_is_its_value_with_unit_and_meaning_by_default():
    assert nh.Parameter(value=3) == nh.Parameter(value="3", unit="1", meaning="")
    assert nh.Parameter(value=0.1).value == nh.Parameter(value=np.float64(0.1)).value == "0.1"
    made = spring(V=lambda q, k: k * q[0] ** 2 / 2, grad_V=None, parameters={"k": nh.Parameter(value=4)})
    run = nh.integrate(made, "aba864", 0.05, t_end=1)
    frequency, error_of_the_method = 2, 1e-7
    assert abs(run.q.values[-1, 0] - np.cos(frequency)) < error_of_the_method
    assert spring(V=lambda q, k: q[0], grad_V=None, parameters={"k": 4}).parameters["k"].meaning == "k"


def test_fraction_is_exact_decimal_or_has_100_digits():
    made = spring(q0=[Fraction(1, 3)], p0=[Fraction(-5, 8)], t_end=Fraction(7, 2))
    assert made.p0 == ("-0.625",)
    assert made.t_end == "3.5"
    assert made.q0 == ("0." + 100 * "3",)
    run = nh.integrate(made, "leapfrog", 0.1, precision="extended")
    assert Fraction(run.q[0, 0].item()) + Fraction(run.q_low[0, 0].item()) - Fraction(1, 3) < Fraction(1, 2**105)


def test_bare_observable_has_unknown_unit_and_name_as_meaning():
    made = spring(V=lambda q, k: k * q[0] ** 2 / 2, grad_V=None, parameters={"k": 1}, observables={"x2": square})
    run = nh.integrate(made, "aba864", 0.05, t_end=1)
    assert made.observables["x2"] == nh.Observable(function=square, unit="unknown", meaning="x2")
    assert pickle.loads(pickle.dumps(made.observables)) == made.observables
    assert np.array_equal(run.x2.values, run.q.values[:, 0] ** 2)


def test_scales_and_times_may_be_numbers():
    made = spring(t_end=3, energy_scale=0.1, position_t_end=2)
    assert (made.t_end, made.energy_scale, made.position_t_end) == ("3", "0.1", "2")


def test_a_tableau_has_its_name_as_label_by_default():
    fields = {"order": 2, "first": "kick", "kick": ("0.5", "0.5"), "drift": ("1",), "source": "here", "digits": 15}
    assert nh.Tableau(name="mine", **fields).label == "mine"
    assert nh.Tableau(name="mine", label="Mine", **fields).label == "Mine"


def namespace(kind):
    made = kind("box")
    made.k = 1.0
    return made


@pytest.mark.parametrize(
    ("box", "change", "read"),
    [
        (lambda: namespace(ModuleType), lambda box: setattr(box, "k", 4.0), lambda box: box.k),
        (lambda: namespace(lambda name: type(name, (), {})), lambda box: setattr(box, "k", 4.0), lambda box: box.k),
        (lambda: SimpleNamespace(k=[1.0]), lambda box: box.k.append(4.0), lambda box: box.k[-1]),
        (lambda: np.ones(1), lambda box: box.fill(4.0), lambda box: float(box[0])),
        (lambda: {"k": (1.0, 0)}, lambda box: box.update(k=(4.0, 0)), lambda box: box["k"][0]),
    ],
    ids=["module", "class", "namespace", "array", "mapping"],
)
@pytest.mark.parametrize("given", [False, True])
def test_values_that_formulas_read_may_change_between_runs(box, change, read, given):
    """H = k (p^2 + q^2)/2 for k = 1, then 4: the phase of the method's error is below 1e-7."""
    kept = box()
    more = {"grad_V": lambda q: (read(kept) * q[0],), "grad_T": lambda p: (read(kept) * p[0],)} if given else {}
    half = partial(lambda kept, x: read(kept) * x[0] ** 2 / 2, kept)
    made = spring(V=half, T=half, **({"grad_V": None} | more))
    first = nh.integrate(made, "aba864", 0.02, t_end=1)
    assert first.identical(nh.integrate(made, "aba864", 0.02, t_end=1))
    change(kept)
    second = nh.integrate(made, "aba864", 0.02, t_end=1)
    assert [float(run.q.values[-1, 0]) for run in (first, second)] == pytest.approx([cos(1), cos(4)], abs=1e-7)
    assert second.max_energy_error < 1e-7
    assert second.identical(nh.integrate(replace(made), "aba864", 0.02, t_end=1))
    assert (made.grad_V((1.0,)), made.grad_T((1.0,))) == ((4.0,), (4.0,))


def test_what_a_system_was_made_from_is_read_only():
    masses, parameters = [1.0], {"k": "1"}
    made = spring(
        V=lambda q, k: k * q[0] ** 2 / 2, grad_V=None, parameters=parameters, masses=masses, frequencies=["1"]
    )
    before = nh.integrate(made, "ruth", 0.1, t_end=1)
    masses[0] = parameters["k"] = 9.0
    for name in ("parameters", "units", "observables", "invariants"):
        with pytest.raises(SystemDefinitionError, match="are read-only: make a copy of the system"):
            getattr(made, name)["k"] = nh.Parameter(value="9")
        with pytest.raises(SystemDefinitionError, match="read-only"):
            getattr(made, name).update(k="9")
    assert (made.masses, type(made.frequencies)) == ((1.0,), tuple)
    assert nh.integrate(made, "ruth", 0.1, t_end=1).identical(before)
    assert copy.deepcopy(made.parameters) == pickle.loads(pickle.dumps(made.parameters)) == made.parameters


# --- Formulas that are refused, by their names: for the order or number of their arguments, or for what they do


TWO = {"m": "1", "k": "4"}


def made(parameters=TWO, **formulas):
    return spring("sw", **({"grad_V": None, "parameters": parameters} | formulas))


def wrapped(V):
    @wraps(V)
    def passed(*given):
        return V(*given)

    return passed


class OfAnotherOrder:
    def __call__(self, q, k, m):
        return k * q[0] ** 2 / m


ORDERS = {
    "V": {"V": lambda q, k, m: k * q[0] ** 2},
    "wrapped V": {"V": wrapped(lambda q, k, m: k * q[0] ** 2)},
    "callable V": {"V": OfAnotherOrder()},
    "V of time": {"V": lambda q, t, k, m: k * q[0] ** 2 + t, "time_dependent": True},
    "grad_V": {"V": lambda q, m, k: k * q[0] ** 2, "grad_V": lambda q, k, m: (2 * k * q[0],)},
    "T": {"V": lambda q, m, k: k * q[0] ** 2, "T": lambda p, k, m: p[0] ** 2 / m},
    "grad_T": {"V": lambda q, m, k: k * q[0] ** 2, "T": lambda p, *_: p[0] ** 2, "grad_T": lambda p, k, m: (2 * p[0],)},
}


@pytest.mark.parametrize("case", ORDERS)
def test_parameters_named_in_another_order_are_refused(case):
    formula = case.split()[-1] if case != "V of time" else "V"
    words = f"sw: {formula} takes (k, m), and parameters are in the order (m, k)"
    with pytest.raises(SystemDefinitionError, match=f"^{re.escape(words)}$"):
        made(**ORDERS[case])


def test_parameters_of_other_names_are_taken_by_position():
    potentials = (
        lambda q, mass, k: k * q[0] ** 2 / mass,
        lambda q, *k: k[1] * q[0] ** 2 / k[0],
        lambda q, k, n: n * q[0] ** 2 / k,
        partial(lambda factor, q, m, k: factor * k * q[0] ** 2 / m, 1),
    )
    for V in potentials:
        assert made(V=V).energy((1.0,), (0.0,), (1.0, 4.0)) == 4


COUNTS = {
    "V takes (q, g), and is called as V(q): parameters has no 'g'": {"V": lambda q, g: g * q[0], "parameters": {}},
    "V takes (q, t), and is called as V(q): a potential that depends on the time t needs time_dependent=True": {
        "V": lambda q, t: q[0] * t, "parameters": {},
    },
    "V takes (q), and is called as V(q, m, k): it takes all parameters, also those that only masses or T use": {
        "V": lambda q: q[0], "masses": ("m",),
    },
    "V takes (q, m, k), and is called as V(q, t, m, k): with time_dependent=True it takes the time": {
        "V": lambda q, m, k: q[0], "time_dependent": True,
    },
    "V takes (q, m, k, *, s), and is called as V(q, m, k)": {"V": lambda q, m, k, *, s: q[0]},
    "T takes (p, m), and is called as T(p, m, k): it takes all parameters": {
        "V": lambda q, m, k: q[0], "T": lambda p, m: p[0] ** 2 / m,
    },
    "T takes (p, m), and is called as T(p): parameters has no 'm'": {
        "V": lambda q: q[0], "T": lambda p, m: p[0] ** 2 / m, "parameters": {},
    },
    "grad_V takes (q), and is called as grad_V(q, m, k)": {"V": lambda q, m, k: q[0], "grad_V": lambda q: (1,)},
}  # fmt: skip


@pytest.mark.parametrize("words", COUNTS)
def test_formulas_of_another_number_of_arguments_are_refused(words):
    with pytest.raises(SystemDefinitionError, match=f"^sw: {re.escape(words)}"):
        made(**COUNTS[words])


def test_arguments_with_defaults_and_functions_without_signature_are_left_alone():
    assert made(V=lambda q, m, k, more=2: q[0] ** more).energy((3.0,), (0.0,), (1.0, 4.0)) == 9
    assert made(V=lambda q, *, more=2: q[0] ** more, parameters={}).energy((3.0,), (0.0,)) == 9
    assert made(V=max, parameters={}).energy((3.0,), (0.0,)) == 3


# --- formulas that cannot be traced -----------------------------------------------------------------------------------


def sine(q):
    return (math.sin(q[0]),)


REFUSED = {
    **{
        relation.__name__: (lambda q, relation=relation: (1 if relation(q[0], 0) else 2,), "grad_V compares a value")
        for relation in (operator.eq, operator.ne, operator.lt, operator.le, operator.gt, operator.ge)
    },
    "numpy's": (lambda q: (1 if np.float64(0) < q[0] else 2,), "grad_V compares a value"),
    "not": (lambda q: (1 if not q[0] else 2,), "grad_V uses a value as a condition"),
    "set": (lambda q: (len({q[0]}),), "grad_V hashes a value"),
    "math": (sine, "grad_V converts a value to float, as the functions of the module math do: .*nearharmonic.math$"),
    "array": (lambda q: (np.array(q, dtype=float)[0],), "grad_V converts a value to float"),
    "numpy": (lambda q: (np.sin(q[0]),), "grad_V calls a function of numpy, .*: from nearharmonic.math import exp$"),
    "interpolation": (
        lambda q: (np.interp(q[0], [0, 1], [0, 2]),),
        r"grad_V calls numpy.interp, which needs numbers: .* polynomial fit, or .* numba.njit "
        r"\(docs/how_to/tabulated_potentials.md\)$",
    ),
    "polynomial": (lambda q: (np.polyval([1, 2], q[0]),), "grad_V calls numpy.polyval, which needs numbers: "),
    "choice": (lambda q: (np.where([True], q[0], 0),), "grad_V calls numpy.where, which needs numbers: "),
    "huge power": (lambda q: (q[0] ** 100000,), "grad_V raises a value to the power 100000, .*nearharmonic.math.pow$"),
    "text as exponent": (lambda q: (q[0] ** "2",), "grad_V raises a value to the power '2': formulas use"),
    "remainder": (lambda q: (q[0] % 2,), "grad_V raises TypeError: .*%.*formulas use"),
    "zero": (lambda q: (q[0] / (0.3 - 0.3),), "grad_V raises ZeroDivisionError"),
    "index": (lambda q: (q[1],), "grad_V raises IndexError: tuple index out of range: q has 1 component$"),
    "arguments": (lambda q: (sine(),), r"grad_V raises TypeError: .* missing 1 required .* argument: 'q'$"),
    "attribute": (lambda q: (q[0].real,), "grad_V raises AttributeError: .*'real'.*formulas use"),
    "attribute of a module": (lambda q: (math.arcsin(q[0]),), "grad_V raises AttributeError: .*'arcsin'$"),
    "name": (lambda q: (nothing,), "grad_V raises NameError"),  # noqa: F821
    "infinite": (lambda q: (math.inf * q[0],), "grad_V contains the number inf, which is not finite"),
    "NaN": (lambda q: (math.nan,), r"grad_V\[0\] contains the number nan"),
    "too many": (lambda q: (q[0], 0), "grad_V returns 2 components, expected a tuple of 1, one number per coordinate"),
    "none": (lambda q: (), "grad_V returns 0 components, expected a tuple of 1"),
    "no tuple": (lambda q: q[0], "grad_V returns one number, expected a tuple of 1"),
    "nothing": (lambda q: None, "grad_V returns None, expected a tuple of 1, .*: is a return missing.$"),
    "text": (lambda q: ("a",), r"grad_V\[0\] is an object of type str, expected a number"),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("tracer", ["kernel", "text"])
def test_formula_that_cannot_be_traced_is_refused_by_its_name(case, tracer):
    grad_V, words = REFUSED[case]
    trace = {"kernel": traced, "text": velocity_text}[tracer]
    with pytest.raises(SystemDefinitionError, match=f"^mine: {words}") as caught:
        trace(spring("mine", grad_V=grad_V))
    missing_cause = case in {"too many", "none", "no tuple", "nothing", "text"}  # nothing was raised by the formula
    assert (caught.value.__cause__ is None) == missing_cause


def traced(made):
    formulas = {name: getattr(made, name) for name in ("V", "grad_V", "T", "grad_T", "name", "dimension")}
    formulas |= {"grad_V_and_V": None, "balanced_T": None}  # of systems of more coordinates
    physics = Physics(**formulas, parameters=0, constants=made.constants(Constant))
    return fingerprint(Rules(physics, extended=True, compensated=True))


@pytest.mark.parametrize("formula", ["V", "grad_V", "T", "grad_T"])
def test_the_error_names_the_formula_that_failed(formula):
    def broken(*_):
        raise KeyError("lost")

    made = spring("mine", **{formula: broken})
    with pytest.raises(SystemDefinitionError, match=f"^mine: {formula} raises KeyError: 'lost'$") as caught:
        traced(made)
    assert isinstance(caught.value.__cause__, KeyError)


@pytest.mark.parametrize(
    ("value", "words"),
    [((), "an object of type tuple, expected one number"), (None, r"None, expected one number: is a return missing\?")],
)
def test_an_energy_that_is_no_number_is_refused(value, words):
    with pytest.raises(SystemDefinitionError, match=f"^mine: V returns {words}$"):
        traced(spring("mine", V=lambda q: value))


@pytest.mark.parametrize(
    "more",
    [
        {"H": lambda q, p: p[0] ** 2 * q[0]},
        {"V": lambda q, p: p[0] * q[0]},
        {"T": lambda q, p: p[0] ** 2 / q[0]},
        {"T": lambda p, q: p[0] ** 2 / q[0]},
    ],
)
def test_energies_of_both_q_and_p_are_sent_elsewhere(more):
    """Magnetic fields, rotating frames, double pendulums: docs/start/choosing.md says where to go."""
    with pytest.raises(SystemDefinitionError, match=r"needs H = T\(p\) \+ V\(q\) .* 'The wrong tool'"):
        spring(**({"grad_V": None} | more))


def test_an_unknown_member_is_told_with_the_nearest():
    with pytest.raises(NearharmonicError, match=r"^System has no argument 'gradV'\. Did you mean 'grad_V'\?"):
        spring(gradV=None)
