"""Short forms of declarations of a system, and their meanings."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import cos
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SystemDefinitionError
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
