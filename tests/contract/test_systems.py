"""Every registered system: its gradients against differences of its energies, its units, its invariants."""

from __future__ import annotations

import re

import pytest
from mpmath import diff, mpf

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.systems import Parameter, System

#: A point off every axis, away from the start, so that no term of a gradient vanishes by symmetry.
POINT = ("0.37", "-0.21", "0.53", "0.11", "-0.43", "0.29")


def _constants(system):
    return [mpf(parameter.value) for parameter in system.parameters.values()]


def _partial(function, point, i):
    """d function / d point[i] by mpmath's differences: at 60 digits its error is near 1e-30."""
    return diff(lambda x: function((*point[:i], x, *point[i + 1 :])), point[i])


@pytest.fixture(params=sorted(nh.systems))
def system(request):
    return nh.systems[request.param]


def test_grad_V_is_the_gradient_of_V(system):
    q = tuple(map(mpf, POINT[: system.dimension]))
    constants = _constants(system)
    for i, slope in enumerate(system.grad_V(q, *constants)):
        assert abs(slope - _partial(lambda x: system.V(x, *constants), q, i)) < mpf(10) ** -25


def test_grad_T_is_the_gradient_of_T(system):
    p = tuple(map(mpf, POINT[: system.dimension]))
    for i, slope in enumerate(system.grad_T(p)):
        assert abs(slope - _partial(system.T, p, i)) < mpf(10) ** -25


def test_quadratic_kinetic_energy_is_declared_rightly(system):
    p = tuple(map(mpf, POINT[: system.dimension]))
    quadratic = all(abs(v - u) < mpf(10) ** -50 for v, u in zip(system.grad_T(p), p, strict=True))
    assert system.quadratic_kinetic_energy == quadratic


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


def test_a_system_says_its_units_its_source_and_why_it_counts_as_left(system):
    assert set(system.units) >= {"q", "p", "t", "energy"}
    assert all(system.units.values())
    assert system.source
    assert system.surface_reason
    assert system.surface_limit > 0
    assert all(parameter.unit and parameter.meaning for parameter in system.parameters.values())


def test_henon_heiles_starts_at_energy_one_eighth():
    """Nielsen (2015), below Eq. 18."""
    system = nh.systems["henon_heiles"]
    q, p = (tuple(map(mpf, row)) for row in (system.q0, system.p0))
    assert system.T(p) + system.V(q) == mpf(1) / 8 or abs(system.T(p) + system.V(q) - mpf(1) / 8) < mpf(10) ** -58


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
    ("change", "words"),
    [
        ({"q0": ("1", "2")}, "q0 has 2 components and p0 1"),
        ({"p0": ("nan",)}, "p0[0] = 'nan'"),
        ({"t_end": "soon"}, "t_end = 'soon'"),
        ({"units": {"q": "m", "p": "m"}}, "units lack 't'"),
        ({"parameters": {"k": Parameter(value="inf", unit="1", meaning="stiffness")}}, "parameter k = 'inf'"),
    ],
)
def test_a_contradictory_system_cannot_be_built(change, words):
    sound = nh.systems["sho"]
    fields = {name: getattr(sound, name) for name in ("name", "label", "V", "grad_V", "q0", "p0", "t_end", "units")}
    with pytest.raises(NearharmonicError, match=re.escape(words)):
        System(**(fields | {"source": "here"} | change))


def test_a_formula_that_branches_on_a_value_is_refused_with_the_systems_name():
    def grad_V(q):
        return (q[0] if q[0] else -q[0],)

    sound = nh.systems["sho"]
    fields = {name: getattr(sound, name) for name in ("label", "V", "q0", "p0", "t_end", "units", "source")}
    with pytest.raises(NearharmonicError, match=r"bent: its formulas cannot be compiled: .*branch"):
        nh.integrate(System(name="bent", grad_V=grad_V, **fields), "ruth", 0.1)
