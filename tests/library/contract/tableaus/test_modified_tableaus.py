"""Declared orders of methods with modified potentials, proved from their printed coefficients."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, localcontext

import pytest
from mpmath import eye, mpf

import nearharmonic as nh
from nearharmonic.exact.words import oscillator
from nearharmonic.theory.order import harmonic_orders_of, leading_errors, nystrom_order_of
from nearharmonic.theory.order_conditions import step_of
from nearharmonic.theory.oscillator import lambda_max, zeta
from support.oracles.reference_solutions import oscillator_step

EVERY = pytest.mark.parametrize("name", list(nh.modified_integrators))


@EVERY
def test_declared_order_is_one_proved_for_quadratic_kinetic_energy(name):
    tableau = nh.modified_integrators[name]
    assert nystrom_order_of(tableau) == nh.order_of(name) == tableau.order
    assert leading_errors(tableau).nystrom.degree == tableau.order + 1
    assert min(harmonic_orders_of(name)) >= tableau.order


@pytest.mark.parametrize(
    ("name", "key"),
    [
        (name, key)
        for name, one in nh.modified_integrators.items()
        for key in ("kick", "drift", "square")
        if key == "square" or len(getattr(one, key)) > 2  # the sum alone determines two that are equal
    ],
)
def test_a_wrong_digit_ten_places_before_the_last_is_found(name, key):
    tableau = nh.modified_integrators[name]
    with localcontext(prec=200):
        row = [Decimal(c) for c in getattr(tableau, key)]
        step = Decimal(1).scaleb(10 - tableau.digits)
        if key == "square":
            row = [x + step if x else x for x in row]
        else:
            count = len(row)
            row[0], row[-1] = row[0] + step, row[-1] + step
            row[count // 2] -= step if count % 2 == 0 else 2 * step
            if count % 2 == 0:
                row[count // 2 - 1] -= step
    forged = replace(tableau, **{key: tuple(map(str, row))}, name="forged")
    assert nystrom_order_of(forged) == 2


@EVERY
def test_without_the_square_the_order_is_two(name):
    tableau = nh.modified_integrators[name]
    assert nystrom_order_of(replace(tableau, square=("0",) * len(tableau.kick))) == 2


def step_matrix(tableau, tau):
    """The product of the matrices of a step, between its processor and the inverse."""
    step = oscillator_step(tableau, tau)
    behind = oscillator_step(tableau.processor, tau) if tableau.processed else eye(2)
    return behind * step * behind**-1


@EVERY
def test_step_matrices_on_the_oscillator_are_products_of_matrices(name):
    tau, K = mpf("0.7"), oscillator(step_of(nh.modified_integrators[name]))
    step = step_matrix(nh.modified_integrators[name], tau)
    for place, row in zip(((0, 0), (0, 1), (1, 0), (1, 1)), (K.K11, K.K12, K.K21, K.K22), strict=True):
        value = sum(mpf(c.numerator) / c.denominator * tau**n for n, c in enumerate(row))
        assert abs(value - step[place]) < mpf(10) ** -50


@pytest.mark.slow
@EVERY
def test_the_largest_stable_step_is_that_of_the_trace(name):
    tableau = nh.modified_integrators[name]
    limit = nh.stability_limit(name)
    K = oscillator(step_of(tableau))

    def trace(tau):
        return sum(float(a + b) * tau**n for n, (a, b) in enumerate(zip(K.K11, K.K22, strict=True)))

    assert abs(abs(trace(limit)) - 2) < 1e-9
    assert all(abs(trace(limit * (i + 0.5) / 200)) <= 2 for i in range(200))


def test_gradient_is_counted_where_kicks_of_neighbouring_steps_meet_too():
    tableau = nh.modified_integrators["chin_4a"]
    assert tableau.gradients == 1
    assert replace(tableau, square=("0.01", "0", "0.01")).gradients == 1
    assert replace(tableau, square=("0.01", "0.01", "0.01")).gradients == 2
    assert tableau.facts["gradients"] == 1


@EVERY
def test_error_terms_reach_to_the_highest_power_of_the_step(name):
    """The coefficients of the new position from q = -p = 1, as the derivatives of products of matrices."""
    tableau = nh.modified_integrators[name]
    highest, found = lambda_max(tableau), zeta(tableau)
    assert len(found) == highest + 1
    for tau in (mpf("0.3"), mpf("1.7")):
        value, step = (
            sum(mpf(c.numerator) / c.denominator * tau**n for n, c in enumerate(found)),
            step_matrix(tableau, tau),
        )
        assert abs(value - (step[0, 0] - step[0, 1])) < mpf(10) ** -45
    assert nh.kappa(tableau, highest + 2)[-2:] == [1, 1]
    assert nh.kappa(tableau, highest)[-1] != 1
