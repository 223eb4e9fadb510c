"""Masses and mass matrices: the kinetic energies that they make, normal modes, Nystrom methods, what is refused."""

import re
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import log2

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine.settings import check_fit
from nearharmonic.errors import NearharmonicError, SystemDefinitionError
from support.methods.own_systems import spring
from support.oracles.multiprecision import energy_errors

MATRIX = (("2", "0.5", "0"), ("0.5", "1", "1/3"), ("0", "1/3", "3"))
NYSTROM = {"srkn_b11": 6, "babs7o7h": 4}


def chain(q):
    return sum((b - a) ** 2 / 2 for a, b in pairwise((0, *q, 0)))


def anharmonic(q):
    return chain(q) + sum((b - a) ** 3 / 3 + (b - a) ** 4 / 4 for a, b in pairwise((0, *q, 0)))


def masses(given, V=chain, **more):
    return spring(V=V, grad_V=None, q0=("0.3", "-0.1", "0.2"), p0=("0.1", "0", "-0.2"), masses=given, **more)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.lists(st.fractions(-3, 3, max_denominator=5), min_size=3, max_size=3), min_size=3, max_size=3))
def test_the_inverse_of_a_mass_matrix_is_exact(rows):
    """M = A A^T + 1 is positive definite: M times the velocities is p, in fractions."""
    A = np.array(rows, dtype=object)
    M = A @ A.T + np.diag([Fraction(1)] * 3)
    made = masses(tuple(map(tuple, M)))
    p = (Fraction(1, 3), Fraction(-2), Fraction(5, 7))
    velocity = made.grad_T(p)
    assert tuple(M @ np.array(velocity, dtype=object)) == p
    assert made.T(p) == sum(x * v for x, v in zip(p, velocity, strict=True)) / 2
    assert made.quadratic_kinetic_energy


@pytest.mark.slow
def test_masses_are_numbers_or_names_of_parameters():
    made = masses(("0.5", "1/3", "m"), V=lambda q, m, k: k * chain(q), parameters={"m": "4", "k": "1"})
    assert made.grad_T((1.0, 1.0, 1.0), 4.0, 1.0) == (2.0, 3.0, 0.25)
    assert made.T((1.0, 1.0, 1.0), 4.0, 1.0) == pytest.approx(5.25 / 2)
    assert made.energy((0.0, 0.0, 1.0), (1.0, 1.0, 1.0), (4.0, 3.0)) == pytest.approx(5.25 / 2 + 3)
    same = masses(("0.5", "1/3", "4"))
    runs = [nh.integrate(s, "aba864", 0.1, t_end=5) for s in (made, same)]
    assert runs[0].q.values == pytest.approx(runs[1].q.values, abs=1e-13)
    # Unit masses are the default.
    assert masses(("1", "1", "1")).unit_masses
    assert not same.unit_masses


@pytest.mark.slow
def test_one_text_serves_floats_arrays_mpmath_and_double_double():
    made = masses(MATRIX)
    floats = made.grad_T((0.1, 0.2, 0.3))
    arrays = made.grad_T(tuple(np.array([x, x]) for x in (0.1, 0.2, 0.3)))
    exact = made.grad_T(tuple(map(mpf, ("0.1", "0.2", "0.3"))))
    assert all(isinstance(x, float) for x in floats)
    assert floats == pytest.approx([float(x) for x in exact], rel=1e-15)
    assert [x[1] for x in arrays] == list(floats)
    run = nh.integrate(made, "srkn_a14", 0.02, t_end=1, precision="extended")
    assert run.max_energy_error.item() < 1e-15


@pytest.mark.parametrize("given", [("2", "1/3", "5"), MATRIX])
def test_a_linear_chain_moves_in_its_normal_modes(given):
    """q(t) = sum of modes of K v = w^2 M v; errors come from rounding, and from the modes in doubles."""
    made = masses(given)
    M = np.diag([2, 1 / 3, 5]) if given is not MATRIX else np.array([[2, 0.5, 0], [0.5, 1, 1 / 3], [0, 1 / 3, 3]])
    K = 2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    # M = L L^T: modes of the symmetric L^-1 K L^-T.
    L = np.linalg.cholesky(M)
    squares, modes = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, K).T))
    w, back = np.sqrt(squares), np.linalg.solve(L.T, modes)
    q0, p0 = (np.array(row) for row in made.start(float))
    a, b = modes.T @ L.T @ q0, modes.T @ np.linalg.solve(L, p0) / w
    run = nh.integrate(made, "srkn_a14", 0.02, t_end=10)
    t = run.t.values[:, None]
    assert run.q.values == pytest.approx((a * np.cos(w * t) + b * np.sin(w * t)) @ back.T, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", NYSTROM)
@pytest.mark.parametrize("given", [("2", "1/3", "5"), MATRIX])
def test_nystrom_methods_keep_their_order_with_masses(name, given):
    """In 60 digits, on a nonlinear chain."""
    made, tableau = masses(given, anharmonic), nh.integrators[name]
    check_fit(made, tableau)
    coarse, fine = (energy_errors(tableau, made, mpf(1) / n, n)[-1] for n in (48, 96))
    assert log2(coarse / fine) == pytest.approx(NYSTROM[name], abs=0.15)


WRITTEN = {
    "a product": lambda p: (p[0] + p[1]) * (p[0] - p[1]) / 4 + p[1] * p[1] + p[2] ** 2,
    "powers": lambda p: ((p[0] + 1) ** 3 - p[0] ** 3 + p[2] ** 2 + p[1] ** 2) / 6,
}


@pytest.mark.parametrize("T", WRITTEN.values(), ids=WRITTEN)
def test_nystrom_methods_take_every_quadratic_kinetic_energy(T):
    made = spring(V=chain, grad_V=None, T=T, q0=("0.3", "-0.1", "0.2"), p0=("0.1", "0", "-0.2"))
    assert made.quadratic_kinetic_energy
    assert nh.integrate(made, "srkn_b11", 0.02, t_end=1).max_energy_error.item() < 1e-8
    for other in (lambda p: p[0] ** 4, lambda p: abs(p[0])):
        with pytest.raises(NearharmonicError, match=r"srkn_b11' is not allowed: it requires a quadratic"):
            check_fit(replace(made, T=other), nh.integrators["srkn_b11"])


def test_a_kinetic_energy_may_depend_on_parameters():
    """p^2 / 2m of an oscillator: frequency sqrt(k / m)."""
    made = spring(V=lambda q, m, k: k * q[0] ** 2 / 2, grad_V=None, T=lambda p, m, k: p[0] ** 2 / (2 * m),
                  parameters={"m": "4", "k": "9"})  # fmt: skip
    assert (made.quadratic_kinetic_energy, made.unit_masses) == (True, False)
    assert made.grad_T((3.0,), 4.0, 9.0) == (0.75,)
    assert made.energy((1.0,), (2.0,), (4.0, 9.0)) == 5.0
    run = nh.integrate(made, "srkn_a14", 0.02, t_end=10)
    assert run.q.values[:, 0] == pytest.approx(np.cos(1.5 * run.t.values), abs=1e-13)


REFUSED = [
    (("1", "2"), "masses has 2 entries, expected 3, one per coordinate"),
    ("123", "masses = '123' is no tuple of 3 masses"),
    (7, "masses = 7 is no tuple"),
    (("1", "0", "2"), "masses[1] = '0' is not allowed: a mass must be positive"),
    (("1", "-2", "2"), "masses[1] = '-2' is not allowed: a mass must be positive"),
    (("1", "nan", "2"), "masses[1] = 'nan' is not allowed: it must be a decimal string or a fraction"),
    (("1", "1e400", "2"), "masses[1] = '1e400' is not allowed: it must be a decimal string or a fraction"),
    (
        ("1", "heavy", "2"),
        "masses[1] = 'heavy' is not allowed: it must be a decimal string or a fraction, such as '0.5', '1/3', and "
        "finite as a double; or the name of a parameter, of which there is none",
    ),
    (("1", float("inf"), "2"), "masses[1] = inf is not allowed: it must be a decimal string"),
    (("1", "1/0", "2"), "masses[1] = '1/0' is not allowed"),
    ((("1", "0"), ("0", "1"), ("0", "0")), "masses[0] has 2 entries, expected 3: the matrix must be square"),
    ((("1", "0", "1"), ("0", "1", "0"), ("0", "0", "1")), "masses[2][0] = '0' differs from masses[0][2] = '1'"),
    ((("1", "1", "0"), ("1", "1", "0"), ("0", "0", "1")), "masses is singular"),
    ((("1", "2", "0"), ("2", "1", "0"), ("0", "0", "1")), "masses is not positive definite"),
    ((("1", "0", "inf"), ("0", "1", "0"), ("inf", "0", "1")), "masses[0][2] = 'inf' is not allowed"),
]


@pytest.mark.parametrize(("given", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_masses_that_make_no_kinetic_energy_are_refused(given, words):
    with pytest.raises(SystemDefinitionError, match=f"^spring: {re.escape(words)}"):
        masses(given)


def test_masses_beside_a_kinetic_energy_are_refused():
    for other in ({"T": lambda p: p[0] ** 2}, {"grad_T": lambda p: p}):
        with pytest.raises(SystemDefinitionError, match="spring: masses and T are both given"):
            masses(("1", "1", "1"), **other)


def test_a_copy_changes_its_masses():
    made = masses(("2", "1", "1"), position_t_end="3")
    assert replace(made, masses=("4", "1", "1")).grad_T((1.0, 0.0, 0.0)) == (0.25, 0.0, 0.0)
    assert replace(made, masses=None).unit_masses
    assert replace(made, t_end="7").position_t_end == "3"
    assert replace(made, t_end="7").T is made.T
    assert replace(made, masses=("3", "1", "1")).position_t_end is None
