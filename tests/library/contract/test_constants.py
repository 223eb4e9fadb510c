"""Constants and units of the systems, compared with independent values in the units of the sources."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic_paper.experiments.paper.reductions import orbital_period

#: NASA Space Science Data Center, Sun and Mercury fact sheets, as Nielsen (2015) has them: km and s.
GM_KM3_S2 = Fraction("1.32712e11")
APHELION_KM = Fraction("69.82e6")
MINIMUM_VELOCITY_KM_S = Fraction("38.86")
SECONDS_PER_HOUR = 3600
#: The system's unit of length in km.
UNIT_KM = 10**6

#: Name -> (q0, p0, t_end, H0), as the paper's captions and Zarmi (2023) state them, in the unit of each system.
STARTS = {
    "sho": (("1",), ("0",), 500, Fraction(1, 2)),
    "henon_heiles": (("0.3", "0"), ("0", "0.4"), 500, Fraction(1, 8)),
    "relativistic_oscillator": (("1",), ("0",), 500, Fraction(1, 2)),
    "kepler": (
        (str(APHELION_KM / UNIT_KM), "0"),
        ("0", str(MINIMUM_VELOCITY_KM_S * SECONDS_PER_HOUR / UNIT_KM)),
        10 * 8766,  # ten Julian years of 365.25 days, in hours
        (MINIMUM_VELOCITY_KM_S**2 / 2 - GM_KM3_S2 / APHELION_KM) * Fraction(SECONDS_PER_HOUR, UNIT_KM) ** 2,
    ),
}
# The same orbit in a fictitious time.
STARTS["kepler_regularised"] = STARTS["kepler"]


@pytest.mark.parametrize("name", STARTS)
def test_system_starts_where_its_source_says_and_runs_as_long(name):
    system, (q0, p0, t_end, _) = nh.systems[name], STARTS[name]
    assert [Fraction(x) for x in system.q0] == [Fraction(x) for x in q0]
    assert [Fraction(x) for x in system.p0] == [Fraction(x) for x in p0]
    assert Fraction(system.t_end) == t_end


@pytest.mark.parametrize("name", STARTS)
def test_a_system_starts_with_its_energy(name):
    system = nh.systems[name]
    q, p = ([float(x) for x in row] for row in (system.q0, system.p0))
    constants = [float(Fraction(parameter.value)) for parameter in system.parameters.values()]
    # A few operations, each rounded by 1.1e-16 of at most four times the sum.
    assert system.T(tuple(p)) + system.V(tuple(q), *constants) == pytest.approx(float(STARTS[name][3]), rel=2e-15)


def test_the_sun_pulls_with_all_the_digits_of_its_source():
    """km^3 s^-2 to (10^6 km)^3 h^-2."""
    parameter = nh.systems["kepler"].parameters["GM"]
    assert Fraction(parameter.value) == GM_KM3_S2 * SECONDS_PER_HOUR**2 / UNIT_KM**3
    assert parameter.unit == "1e18 km3 h-2"


def test_units_are_those_of_the_numbers():
    plain = dict.fromkeys(("q", "p", "t", "energy"), "1")
    orbit = {"q": "1e6 km", "p": "1e6 km h-1", "t": "h", "energy": "1e12 km2 h-2"}
    expected = dict.fromkeys(STARTS, plain) | {"kepler": orbit, "kepler_regularised": orbit}
    assert {name: dict(nh.systems[name].units) for name in STARTS} == expected


def test_period_follows_from_keplers_third_law_in_km_and_s():
    semi_major_axis = 1 / (2 / APHELION_KM - MINIMUM_VELOCITY_KM_S**2 / GM_KM3_S2)  # the vis-viva equation
    seconds = 2 * math.pi * math.sqrt(semi_major_axis**3 / GM_KM3_S2)
    assert orbital_period(nh.systems["kepler"]) == pytest.approx(seconds / SECONDS_PER_HOUR, rel=1e-14)
    assert math.isnan(orbital_period(nh.systems["henon_heiles"]))


@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0, -2.0])
def test_perihelion_is_opposite_to_aphelion_and_turns_with_orbit(turn):
    """Begun at the aphelion in direction ``turn``, the orbit counterclockwise."""
    system = nh.systems["kepler"]
    r, v = float(system.q0[0]), float(system.p0[1])
    c, s = np.cos(turn), np.sin(turn)
    q, p = tuple(np.array([[r * c], [r * s]])), tuple(np.array([[-v * s], [v * c]]))
    (angle,) = system.observables["perihelion_angle"].function(q, p, float(system.parameters["GM"].value))
    assert np.exp(1j * angle) == pytest.approx(-np.exp(1j * turn), abs=1e-14)


def test_diverged_run_has_energy_error_of_one_except_oscillator_ellipses():
    limits = {name: nh.systems[name].surface_limit for name in STARTS}
    assert limits == dict.fromkeys(STARTS, 1.0) | {"sho": 1e6}
