"""Every registered system: gradients, units, invariants and constants against independent values."""

import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import diff, mpf

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.systems import Parameter, System
from nearharmonic.systems.gradients import check_gradients
from nearharmonic_paper.experiments.paper.reductions import orbital_period
from support.oracles.multiprecision import Multiprecision, value_of
from support.oracles.reference_solutions import kepler_state

# --- every registered system: its gradients against differences of its energies, its units, its invariants ------------


#: A point off every axis, away from the start, so that no term of a gradient vanishes by symmetry.
POINT = ("0.37", "-0.21", "0.53", "0.11", "-0.43", "0.29")


def _constants(system):
    return system.constants(mpf)


def _called(formula):
    """``formula`` as a function of mpmath numbers in which float literals are exact."""

    def function(point, *constants):
        result = formula(tuple(map(Multiprecision, point)), *map(Multiprecision, constants))
        return tuple(map(value_of, result)) if isinstance(result, tuple) else value_of(result)

    return function


def _partial(function, point, i):
    """d function / d point[i] by mpmath's differences: at 60 digits its error is near 1e-30."""
    return diff(lambda x: function((*point[:i], x, *point[i + 1 :])), point[i])


@pytest.fixture(params=sorted(nh.systems))
def system(request):
    return nh.systems[request.param]


def test_grad_V_is_the_gradient_of_V(system):
    q = tuple(map(mpf, POINT[: system.dimension]))
    constants = _constants(system)
    for i, slope in enumerate(_called(system.grad_V)(q, *constants)):
        assert abs(slope - _partial(lambda x: _called(system.V)(x, *constants), q, i)) < mpf(10) ** -25


def test_grad_T_is_the_gradient_of_T(system):
    p = tuple(map(mpf, POINT[: system.dimension]))
    for i, slope in enumerate(_called(system.grad_T)(p)):
        assert abs(slope - _partial(_called(system.T), p, i)) < mpf(10) ** -25


def test_quadratic_kinetic_energy_is_declared_rightly(system):
    p = tuple(map(mpf, POINT[: system.dimension]))
    quadratic = all(abs(v - u) < mpf(10) ** -50 for v, u in zip(system.grad_T(p), p, strict=True))
    assert system.quadratic_kinetic_energy == quadratic


def _harmonic(q, *_):
    return q[0] ** 2 / 2 if len(q) == 1 else None


def _attraction(q, *constants):
    # Of GM alone: a system with another parameter attracts so for one value of it only.
    return -constants[0] / mpmath.sqrt(sum(x * x for x in q)) if len(constants) == 1 else None


@pytest.mark.parametrize(("name", "potential"), [("harmonic", _harmonic), ("gravity", _attraction)])
def test_system_declares_exactly_the_properties_of_its_potential(system, name, potential):
    """V = q^2/2 of one coordinate, V = -GM/|q|; T = p.p/2 for both."""
    q = tuple(map(mpf, POINT[: system.dimension]))
    expected = potential(q, *_constants(system))
    same = expected is not None and abs(_called(system.V)(q, *_constants(system)) - expected) < mpf(10) ** -50
    assert getattr(system, name) == (same and system.quadratic_kinetic_energy)


@pytest.mark.parametrize("system", [s for s in nh.systems.values() if s.exact_position], ids=lambda s: s.name)
def test_exact_position_obeys_equations_of_motion_from_initial_values(system):
    """q'' = -grad_V at some time, by mpmath's differences."""
    (q0, p0), t = system.start(mpf), mpf("0.37") * mpf(system.t_end)
    force = system.grad_V(system.exact_position(system, t), *_constants(system))
    for i in range(system.dimension):

        def component(t, i=i):
            return system.exact_position(system, t)[i]

        assert abs(component(mpf(0)) - q0[i]) < mpf(10) ** -50 * max(map(abs, q0))
        assert abs(diff(component, 0) - p0[i]) < mpf(10) ** -25 * max(map(abs, p0), default=0) + mpf(10) ** -25
        assert abs(diff(component, t, 2) + force[i]) < mpf(10) ** -20 * max(map(abs, force))


def test_the_oscillators_exact_position_turns_with_its_own_start():
    sho = nh.systems["sho"]
    moved = replace(sho, q0=("-0.3",), p0=("0.7",))
    for t in (mpf(0), mpf("1.25"), mpf(500)):
        assert abs(sho.exact_position(sho, t)[0] - mpmath.cos(t)) < mpf(10) ** -55
        expected = mpmath.sqrt(mpf("0.58")) * mpmath.cos(t - mpmath.atan2(mpf("0.7"), mpf("-0.3")))
        assert abs(sho.exact_position(moved, t)[0] - expected) < mpf(10) ** -55


def test_exact_planet_position_solves_keplers_equation_for_own_mass():
    planet = nh.systems["kepler"]
    given = (planet.q0[0], planet.p0[1], planet.parameters["GM"].value)
    x, y, u, v = (mpmath.nstr(number, 45) for number in kepler_state(*given, 700))
    moved, expected = replace(planet, q0=(x, y), p0=(u, v)), kepler_state(*given, 700 + 5000)
    # 45 digits of the start, over 2.4 periods.
    for a, b in zip(planet.exact_position(moved, mpf(5000)), expected[:2], strict=True):
        assert abs(a - b) < mpf(10) ** -38
    unit = Parameter(value="1", unit="1", meaning="gravitational constant times mass, the unit")
    scaled = replace(planet, parameters={"GM": unit}, q0=("1.5", "0"), p0=("0", "0.5"))
    for a, b in zip(scaled.exact_position(scaled, mpf(77)), kepler_state("1.5", "0.5", 1, 77)[:2], strict=True):
        assert abs(a - b) < mpf(10) ** -50
    assert planet.exact_position(replace(planet, p0=("0", "0.333")), mpf(1)) is None  # unbound


def test_invariants_commute_with_the_energy(system):
    """The Poisson bracket {I, H} vanishes, away from the start."""
    q, p = tuple(map(mpf, POINT[: system.dimension])), tuple(map(mpf, POINT[3 : 3 + system.dimension]))
    constants = _constants(system)
    for invariant in system.invariants.values():
        value = invariant(q, p, *constants)
        for k in range(len(value) if isinstance(value, tuple) else 1):

            def component(x, y, invariant=invariant, k=k):
                value = invariant(x, y, *constants)
                return value[k] if isinstance(value, tuple) else value

            bracket = sum(
                _partial(lambda x: component(x, p), q, i) * system.grad_T(p)[i]
                - _partial(lambda y: component(q, y), p, i) * system.grad_V(q, *constants)[i]
                for i in range(system.dimension)
            )
            assert abs(bracket) < mpf(10) ** -25


def test_system_states_units_source_and_reason_of_divergence(system):
    assert set(system.units) >= {"q", "p", "t", "energy"}
    assert all(system.units.values())
    assert system.source
    assert system.surface_reason
    assert system.surface_limit > 0
    assert all(parameter.unit and parameter.meaning for parameter in system.parameters.values())


def test_mercury_has_its_known_eccentricity_and_period():
    """NASA fact sheet: eccentricity 0.2056, sidereal period 87.969 d; the rounded speeds give 0.2055 and 87.99 d."""
    system = nh.systems["kepler"]
    q, p = (tuple(map(mpf, row)) for row in (system.q0, system.p0))
    x, y = system.invariants["eccentricity_vector"](q, p, *_constants(system))
    assert abs((x * x + y * y) ** 0.5 - mpf("0.2055")) < 5e-5
    floats = [tuple(map(float, row)) for row in (system.q0, system.p0)]
    period = system.period(*floats, *map(float, _constants(system)))
    assert period / 24 == pytest.approx(87.99, abs=5e-3)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("sho", {"q0": ("1", "0"), "p0": ("0", "0")}, "sho: harmonic means one coordinate"),
        ("relativistic_oscillator", {"harmonic": True}, "relativistic_oscillator: harmonic means .* T = p"),
        ("kepler", {"parameters": {}}, "kepler: gravity means .* GM as the only parameter"),
        ("henon_heiles", {"position_t_end": "soon"}, "position_t_end = 'soon'"),
    ],
)
def test_a_declaration_that_cannot_be_true_is_refused_at_once(name, change, words):
    with pytest.raises(NearharmonicError, match=words):
        replace(nh.systems[name], **change)


OTHER_FORMULAS = [
    ("sho", lambda q: 2 * q[0] ** 2, lambda q: (4 * q[0],)),
    ("sho", lambda q: q[0] ** 2 / 2 + 1, lambda q: q),  # H0 is another, and so are relative errors
    ("kepler", lambda q, GM: GM * (q[0] ** 2 + q[1] ** 2), lambda q, GM: (2 * GM * q[0], 2 * GM * q[1])),
]


@pytest.mark.parametrize(("name", "V", "grad_V"), OTHER_FORMULAS)
def test_potential_other_than_declared_is_refused_at_first_use(name, V, grad_V):
    sound, declared = nh.systems[name], {"sho": "harmonic", "kepler": "gravity"}[name]
    wanted = ("name", "label", "q0", "p0", "t_end", "units", "source", "parameters")
    fields = {key: getattr(sound, key) for key in wanted} | {"V": V, "grad_V": grad_V}
    with pytest.raises(NearharmonicError, match=rf"{name}: {declared} contradicts V: at q = \("):
        check_gradients(System(**fields, **{declared: True}))
    check_gradients(System(**fields))


@pytest.mark.parametrize(("name", "V", "grad_V"), OTHER_FORMULAS)
def test_copy_with_another_potential_drops_what_was_declared_of_first(name, V, grad_V):
    changed = replace(nh.systems[name], V=V, grad_V=grad_V)
    assert (changed.harmonic, changed.gravity, changed.exact_position) == (False, False, None)
    check_gradients(changed)
    assert not replace(changed, t_end="1").exact_position
    own = replace(nh.systems[name], V=V, grad_V=grad_V, exact_position=lambda *_: None)
    assert own.exact_position not in (None, nh.systems[name].exact_position)
    assert replace(nh.systems["henon_heiles"], V=lambda q: q[0] ** 2).position_t_end is None


def test_copy_with_another_start_keeps_declarations():
    for name, change in (("sho", {"q0": ("2",)}), ("kepler", {"parameters": dict(nh.systems["kepler"].parameters)})):
        system, copy = nh.systems[name], replace(nh.systems[name], **change, t_end="7")
        assert (copy.harmonic, copy.gravity) == {"sho": (True, False), "kepler": (False, True)}[name]
        assert copy.exact_position is system.exact_position is not None
    assert replace(nh.systems["henon_heiles"], q0=("0.1", "0")).position_t_end == "20"


def test_parameters_and_start_come_in_the_number_type_asked_for():
    system = nh.systems["kepler"]
    assert system.constants(str) == ("1.71994752",)
    assert system.constants(Fraction) == (Fraction(171994752, 10**8),)
    assert system.constants(float) == (1.71994752,)
    assert system.start(Fraction) == ((Fraction(6982, 100), 0), (0, Fraction(139896, 10**6)))
    assert abs(system.start(mpf)[0][0] * 100 - 6982) < mpf(10) ** -55
    assert nh.systems["sho"].constants(float) == ()


def test_a_registered_system_passes_the_check_of_first_use(system):
    check_gradients(system)


# --- constants and units of the systems, compared with independent values in the units of the sources -----------------


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
