"""Short forms of declarations of a system, and their meanings."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np

import nearharmonic as nh
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
