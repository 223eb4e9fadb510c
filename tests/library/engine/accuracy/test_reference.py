"""Exact positions: closed forms where the system has one of its own, else an orbit followed in extended precision."""

from __future__ import annotations

import dataclasses
from math import inf, nan

import mpmath
import numpy as np
import pytest
from mpmath import cos, mpf

from nearharmonic.engine import reference as reference_module
from nearharmonic.engine.reference import Reference, reference
from nearharmonic.errors import SettingError, SystemDefinitionError
from nearharmonic.systems import systems
from support.methods.own_systems import spring
from support.oracles.reference_solutions import kepler_state


def test_positions_of_oscillator_and_planet_are_those_of_closed_forms():
    sho, kepler = reference(systems["sho"], "500"), reference(systems["kepler"], "87660")
    planet = systems["kepler"]
    exact = kepler_state(planet.q0[0], planet.p0[1], planet.parameters["GM"].value, 87660)
    for found, expected in ((sho.q, [cos(mpf(500))]), (kepler.q, exact[:2])):
        for (high, low), value in zip(found, expected, strict=True):
            assert abs(mpf(high) + mpf(low) - value) < mpf(10) ** -29  # two doubles hold 32 digits of at most 70
    assert (sho.scale, kepler.scale) == (1.0, 69.82)


def test_reference_of_copy_uses_its_own_start_and_parameters():
    """Copies keep the closed form: sin t from (0, 1); Mercury around a star of twice the mass."""
    struck = dataclasses.replace(systems["sho"], q0=("0",), p0=("1",))
    assert reference(struck, "20").error([float(mpmath.sin(20))]) < 1e-15
    near = dataclasses.replace(systems["kepler"], p0=("0", "0.2"), parameters={"GM": "3.43989504"})
    exact = reference(near, "5000")
    expected = kepler_state("69.82", "0.2", "3.43989504", 5000)
    assert exact.source == "closed form in 40 digits"
    assert exact.error([float(x) for x in expected[:2]]) < 1e-15


def test_another_potential_has_no_closed_form_whatever_its_name():
    """A copy of the oscillator, and a system of its name, are followed numerically: cos 2t."""
    stiffer = {"V": lambda q: 2 * q[0] * q[0], "grad_V": lambda q: (4 * q[0],)}
    for system in (dataclasses.replace(systems["sho"], **stiffer), spring("sho", **stiffer)):
        assert reference(system, "3").error([float(cos(mpf(6)))]) < 1e-15


@pytest.mark.parametrize("position", [lambda t: cos(t) + 1, lambda t: cos(2 * t), lambda t: cos(t) + mpmath.sin(t)])
def test_a_closed_form_that_is_none_is_refused(position):
    """From another point, with another period, with another velocity at the start."""
    with pytest.raises(SystemDefinitionError, match="spring: exact_position contradicts"):
        reference(spring(exact_position=lambda _, t: (position(t),)), "20")


def test_orbit_without_closed_form_of_its_own_is_followed_numerically():
    """A hyperbola from its perihelion: x = a (e - cosh F), y = b sinh F, and e sinh F - F proportional to time."""
    fast = dataclasses.replace(systems["kepler"], p0=("0", "0.333"))
    exact = reference(fast, "500")
    assert "double-double" in exact.source
    r, GM = mpf("69.82"), mpf("1.71994752")
    e = r * mpf("0.333") ** 2 / GM - 1
    a = r / (e - 1)
    F = mpmath.findroot(lambda F: e * mpmath.sinh(F) - F - mpmath.sqrt(GM / a**3) * 500, 1)
    expected = a * (e - mpmath.cosh(F)), a * mpmath.sqrt(e * e - 1) * mpmath.sinh(F)
    assert e > 3
    assert exact.error([float(x) for x in expected]) < 1e-15


def test_system_without_closed_form_is_followed_in_extended_precision():
    found = reference(spring(), "20")
    error = abs(mpf(found.q[0, 0]) + mpf(found.q[0, 1]) - cos(mpf(20)))
    # The error that the reference states, which rests on order 6, to a factor of 3; and far below that of a double.
    assert error < 3 * max(found.uncertainty, 1e-30)
    assert found.uncertainty < 1e-17


def test_an_orbit_that_cannot_be_followed_is_refused(monkeypatch):
    monkeypatch.setattr(reference_module, "FIRST_STEPS", 4)
    monkeypatch.setattr(reference_module, "MOST_STEPS", 8)
    with pytest.raises(SettingError, match=r"t_end = '20' is not allowed: the orbit of spring cannot be followed"):
        reference(spring(), "20")


def test_position_errors_are_relative_and_infinite_without_number():
    exact = reference(systems["kepler"], "87660")
    assert exact.error(exact.q[:, 0] + [69.82, 0.0], exact.q[:, 1]) == pytest.approx(1.0, rel=1e-15)
    assert exact.error([nan, 0.0]) == inf


def test_digits_below_a_double_count_on_both_sides():
    exact = Reference(q=np.array([[1.0, 3e-17]]), scale=1.0, uncertainty=0.0, source="")
    assert exact.error(np.array([1.0]), np.array([3e-17])) == 0
    assert exact.error(np.array([1.0]), np.array([1e-17])) == pytest.approx(2e-17)
    assert exact.error(np.array([1.0])) == pytest.approx(3e-17)
