"""Arguments of formulas: their order and number against the parameters, as a signature shows them."""

from __future__ import annotations

import re
from functools import partial, wraps

import pytest

from nearharmonic.errors import SystemDefinitionError
from own_systems import spring

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
    "V takes (q), and is called as V(q, m, k): it takes all parameters, those that only masses or T use too": {
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


def test_arguments_with_defaults_and_functions_without_a_signature_are_left_alone():
    assert made(V=lambda q, m, k, more=2: q[0] ** more).energy((3.0,), (0.0,), (1.0, 4.0)) == 9
    assert made(V=lambda q, *, more=2: q[0] ** more, parameters={}).energy((3.0,), (0.0,)) == 9
    assert made(V=max, parameters={}).energy((3.0,), (0.0,)) == 3
