"""Gradients of observables at the end of runs, against differences in extended precision, closed forms and mpmath."""

from fractions import Fraction
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine import gradient as coefficients
from nearharmonic.errors import SettingError
from nearharmonic.math import cos, exp, sin

EPS = 2.0**-52


def driven(q, t, k, a):
    return -k * cos(q[0]) + a * q[0] * sin(t)


def spring(q, k):
    return k * q[0] * q[0] / 2


def anharmonic(q, k, m):
    return k * q[0] * q[0] / 2 + q[0] * q[0] * q[0] * q[0] / (4 * m)


def relativistic(p, k, m):
    return nh.math.sqrt(m * m + p[0] * p[0]) + k * p[0] / 8


def torque(q, p):
    return q[0] * p[1] - q[1] * q[1]


def weighted(q, p, k, m):
    return k * q[0] * q[0] + exp(-m) * p[0]


def product(q, p):
    return q[0] * p[0] + q[0]


SPRING = nh.System(name="spring", V=spring, q0=["1"], p0=["0.5"], t_end="8", parameters={"k": "2.25"})
START = {"q0": ["1"], "p0": ["0.2"], "t_end": "8", "parameters": {"k": "1.5", "m": "2.5"}}
MASSES = nh.System(name="masses", V=anharmonic, masses=("m",), **START)
KINETIC = nh.System(name="kinetic", V=anharmonic, T=relativistic, **START)
DRIVEN = nh.System(
    name="driven", V=driven, q0=["1"], p0=["0.2"], t_end="8", parameters={"k": "1.5", "a": "0.3"}, time_dependent=True
)
#: System, method (asymmetric ones too), step, end, observable.
CASES = {
    "henon_heiles": ("henon_heiles", "babps8o7h", 0.5, 30, torque),
    "asymmetric": ("henon_heiles", "ruth", 0.1, 30, torque), "implicit": (SPRING, "gauss16", 0.5, 8, product),
    "kepler": ("kepler", "aba864", 30, 3000, torque), "modified": (SPRING, "chin_4a", 0.2, 8, product),
    "oscillator": ("sho", "mclachlan_atela_3", 0.2, 10, product),
    "spring": (SPRING, "mclachlan_atela_4", 0.1, 8, product), "masses": (MASSES, "babps8o7h", 0.25, 8, weighted),
    "kinetic": (KINETIC, "ruth", 0.1, -8, weighted), "driven": (DRIVEN, "ruth", 0.1, 8, product),
}  # fmt: skip
#: Those whose kernels take longest to compile are slow.
SLOW = ("implicit", "modified")
each_case = pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in CASES]
)


def all_of(found):
    names = ["q0", "p0", *(["parameters"] if "parameters" in found else [])]
    return np.concatenate([np.atleast_1d(found[name].values) for name in names])


def differences(system, method, tau, t_end, observable):
    """Central differences in double-double and then 40 digits.

    A relative step of 1e-10 has truncation errors of 1e-20 of a third derivative, and roundings of 1e-31 over 1e-10.
    """
    system = nh.systems[system] if isinstance(system, str) else system
    d, names, found = system.dimension, list(system.parameters), []
    start = [Fraction(x) for x in (*system.q0, *system.p0, *system.constants(str))]
    takes = observable.__code__.co_argcount > 2

    def value(numbers):
        q, p, constants = numbers[:d], numbers[d : 2 * d], numbers[2 * d :]
        given = dict(zip(names, constants, strict=True))
        run = nh.integrate(
            system, method, tau, t_end=t_end, q0=q, p0=p, parameters=given, precision="extended", energy="none",
            samples=2,
        )  # fmt: skip
        q, p = (
            [mp.mpf(x) + mp.mpf(y) for x, y in zip(run[one].values[-1], run[f"{one}_low"].values[-1], strict=True)]
            for one in "qp"
        )
        constants = [mp.mpf(x.numerator) / x.denominator for x in constants]
        return observable(q, p, *(constants if takes else ()))

    with mp.workdps(40):
        for i, x in enumerate(start):
            h = Fraction(1, 10**10) * (abs(x) or 1)
            up, down = (value([y + sign * h * (i == j) for j, y in enumerate(start)]) for sign in (1, -1))
            found.append(float((up - down) / (2 * mp.mpf(h.numerator) / h.denominator)))
        exact = float(value(start))
    return np.array(found), exact


@each_case
def test_gradient_is_that_of_differences(case):
    system, method, tau, t_end, observable = CASES[case]
    expected, value = differences(system, method, tau, t_end, observable)
    found = nh.gradient(system, method, tau, observable, t_end=t_end)
    # Ten roundings a step would be relative to the largest derivative; a random walk has fewer.
    np.testing.assert_allclose(all_of(found), expected, rtol=0, atol=100 * EPS * np.abs(expected).max())
    assert found.value.item() == pytest.approx(value, rel=1e-13, abs=1e-14)
    assert found.status.item() == "ok"


@pytest.mark.slow
@pytest.mark.parametrize("case", ["henon_heiles", "asymmetric", "kepler", "masses", "driven"])
def test_extended_gradient_is_rounded_to_doubles(case):
    system, method, tau, t_end, observable = CASES[case]
    expected, _ = differences(system, method, tau, t_end, observable)
    found = nh.gradient(system, method, tau, observable, t_end=t_end, precision="extended")
    # The differences err by 1e-19 or so, so that both round to one double, or to two neighbours.
    np.testing.assert_allclose(all_of(found), expected, rtol=EPS, atol=1e-18 * np.abs(expected).max())


def test_gradient_of_the_oscillator_is_a_row_of_its_step():
    """Leapfrog is the matrix of kick, drift, kick; the gradient of q(end) is the first row of its power."""
    tau, steps = 0.3, 50
    kick, drift = np.array([[1, 0], [-tau / 2, 1]]), np.array([[1, tau], [0, 1]])
    row = np.linalg.matrix_power(kick @ drift @ kick, steps)[0]
    found = nh.gradient("sho", "leapfrog", tau, lambda q, p: q[0], t_end=15)
    np.testing.assert_allclose(all_of(found), row, rtol=0, atol=10 * steps * EPS)


def chain(q, a):
    """Springs with a cubic term between two walls."""
    sites = [0, *q, 0]
    stretches = [right - left for left, right in pairwise(sites)]
    return sum(x * x / 2 + a * x * x * x / 3 for x in stretches)


@pytest.mark.slow
def test_systems_compiled_as_loops_have_gradients():
    """Differences of doubles over 1e-6 err by 1e-16/1e-6, and by 1e-12 of a third derivative."""
    n, h = 200, 1e-6
    start = {"q0": [str(round(0.1 * np.sin(i), 3)) for i in range(n)], "p0": ["0"] * n, "t_end": "100"}
    system = nh.System(name="chain", V=chain, parameters={"a": "0.25"}, **start)
    found = nh.gradient(system, "babps8o7h", 0.5, lambda q, p: q[0] * p[1])
    ends = [nh.integrate(system, "babps8o7h", 0.5, parameters={"a": 0.25 + s * h}, samples=2) for s in (1, -1)]
    up, down = (end.q.values[-1, 0] * end.p.values[-1, 1] for end in ends)
    assert found.parameters.item() == pytest.approx((up - down) / (2 * h), abs=1e-9)
    run = nh.tangent(system, "babps8o7h", 0.5)
    assert run.status.item() == "ok"
    assert run.sizes["component"] == n


def test_chaotic_run_tells_the_digits_that_it_loses():
    """The gradient in doubles against the gradient in double-doubles, which has 31 digits less the same loss."""
    arguments = "henon_heiles", "babps8o7h", 0.5, torque
    start = {"q0": ["0", "-0.15"], "p0": ["0.49", "0"], "t_end": 300}
    found, exact = (nh.gradient(*arguments, precision=one, **start) for one in ("double", "extended"))
    lost = found.digits_lost.item()
    assert 4 < lost < 14
    # Both lose by the growth of deviations.
    assert abs(exact.digits_lost.item() - lost) < 2.5
    error = np.abs(all_of(found) - all_of(exact)).max() / np.abs(all_of(exact)).max()
    # The curvature of the map multiplies the error of the orbit: "one to three more", in the words of the docstring.
    assert 0.5 < np.log10(error / 2.0**-53) - lost < 3.5
    assert found.round_trip_error.item() == pytest.approx(0.49 * 2.0**-53 * 10**lost, rel=1e-9)


def test_regular_run_loses_no_more_than_its_roundings():
    found = nh.gradient("henon_heiles", "babps8o7h", 0.5, torque, t_end=100, q0=[0, 0.1], p0=[0.4, 0.1])
    assert 0 <= found.digits_lost.item() < 2


def test_members_have_the_bits_of_single_runs():
    q0, k = [[1.0], [0.5], [0.25]], [1.5, 1.25, 2.0]
    many = nh.gradient(MASSES, "leapfrog", 0.1, weighted, q0=q0, parameters={"k": k})
    assert many.sizes["member"] == 3
    assert many.parameter_k.values.tolist() == k
    for i in range(3):
        one = nh.gradient(MASSES, "leapfrog", 0.1, weighted, q0=q0[i], parameters={"k": k[i]})
        for name in one.data_vars:
            expected = many[name].isel(member=i) if "member" in many[name].dims else many[name]
            np.testing.assert_array_equal(one[name], expected)


def test_diverged_run_has_no_gradient():
    found = nh.gradient("henon_heiles", "leapfrog", 3.0, torque, t_end=300)
    assert found.status.item() == "diverged"
    assert np.isnan(all_of(found)).all()


def test_constant_observable_has_no_gradient():
    found = nh.gradient("henon_heiles", "ruth", 0.1, lambda q, p: 2, t_end=1)
    assert found.value.item() == 2
    assert not all_of(found).any()


def branching(q, k):
    return q[0] * q[0] * (1 if k > 1 else 2)


BRANCHING = nh.System(name="branching", V=branching, q0=["1"], p0=["0"], t_end="1", parameters={"k": "2"})


@pytest.mark.parametrize(
    ("system", "method", "key"),
    [
        ("henon_heiles", next(name for name, one in nh.modified_integrators.items() if one.processed), "integrator"),
        (MASSES, "chin_4a", "integrator"),
        (BRANCHING, "ruth", "system"),
    ],
)
def test_runs_without_an_inverse_of_their_kind_are_refused(system, method, key):
    with pytest.raises(nh.NearharmonicError, match=f"^{key} = "):
        nh.gradient(system, method, 0.1, product)


@pytest.mark.slow
def test_gradient_and_deviations_go_on_at_clock_of_result():
    """q'' = -q + cos 2t from (1, 0): q = (4 cos t - cos 2t)/3, and its derivatives over a time t are cos t, sin t."""
    driven = nh.System(
        name="driven_spring", V=lambda q, t: q[0] * q[0] / 2 - q[0] * cos(2 * t), q0=["1"], p0=["0"], t_end="4",
        time_dependent=True,
    )  # fmt: skip
    many = nh.ensemble(driven, "babps8o7h", 0.1, q0=[["1"], ["2"]])
    for start in (nh.problem(driven, "babps8o7h")(0.1), nh.integrate(driven, "babps8o7h", 0.1), many.isel(member=0)):
        found = nh.gradient(driven, "babps8o7h", 0.1, lambda q, p: q[0], t_end=6, start=start)
        end = float(4 * mp.cos(10) - mp.cos(20)) / 3
        np.testing.assert_allclose([found.value, found.q0[0], found.p0[0]], [end, np.cos(6), np.sin(6)], atol=1e-8)
        run = nh.tangent(driven, "babps8o7h", 0.1, t_end=6, deviations=[1, 0], start=start)
        moved = np.exp(run.growth[-1, 0].item()) * np.array([run.deviation_q.item(), run.deviation_p.item()])
        np.testing.assert_allclose([run.q[-1, 0], *moved], [end, np.cos(6), -np.sin(6)], atol=1e-8)
        assert run.t.values[[0, -1]].tolist() == [4, 10]
    several = nh.gradient(driven, "babps8o7h", 0.1, lambda q, p: q[0], t_end=6, start=many)
    np.testing.assert_array_equal(several.value[0], found.value)


# --- Derivatives of runs with respect to coefficients of the method, against complex steps of a plain loop


#: A complex step has no rounding error of its own; 1000 roundings of numbers near 1 are below this.
ROUNDING = 1e-12
TINY = 1e-40


def henon_heiles(q, t):
    x, y = q
    return x + 2 * x * y, y + x * x - y * y


def driven_of_coefficient_gradients(q, t):
    return (1.5 * np.sin(q[0]) + 0.3 * np.sin(t),)


DRIVEN_OF_COEFFICIENT_GRADIENTS = nh.System(
    name="driven", V=lambda q, t, k, a: -k * cos(q[0]) + a * q[0] * sin(t), q0=["1"], p0=["0.2"], t_end="8",
    parameters={"k": "1.5", "a": "0.3"}, time_dependent=True,
)  # fmt: skip


def end_of_loop(force, tableau, kicks, drifts, tau, steps, q, p):
    """State at the end of a plain loop; the time advances with the drifts."""
    q, p, t = [*q], [*p], 0.0
    for _ in range(steps):
        for i in range(max(len(kicks), len(drifts))):
            for operator in ("kick", "drift") if tableau.first == "kick" else ("drift", "kick"):
                if operator == "kick" and i < len(kicks):
                    p = [a - kicks[i] * tau * f for a, f in zip(p, force(q, t), strict=True)]
                elif operator == "drift" and i < len(drifts):
                    q, t = [a + drifts[i] * tau * b for a, b in zip(q, p, strict=True)], t + drifts[i] * tau
    return q, p


def by_complex_steps(force, tableau, tau, steps, q, p, observable):
    rows = {name: np.array([float(c) for c in getattr(tableau, name)], dtype=complex) for name in ("kick", "drift")}
    found = {}
    for name, row in rows.items():
        found[name] = np.empty(len(row))
        for j in range(len(row)):
            moved = rows | {name: row + 1j * TINY * (np.arange(len(row)) == j)}
            end = end_of_loop(force, tableau, moved["kick"], moved["drift"], tau, steps, q, p)
            found[name][j] = observable(*end).imag / TINY
    return found


CASES_OF_COEFFICIENT_GRADIENTS = {
    "drift first": ("henon_heiles", henon_heiles, "ruth", 0.1, 12, (0.1, 0.3), (0.2, -0.1)),
    "kick first": ("henon_heiles", henon_heiles, "babs7o7h", 0.6, 12, (0.1, 0.3), (0.2, -0.1)),
    "asymmetric": ("henon_heiles", henon_heiles, "mclachlan_atela_5", 0.3, -12, (0.1, 0.3), (0.2, -0.1)),
    "driven": (DRIVEN_OF_COEFFICIENT_GRADIENTS, driven_of_coefficient_gradients, "aba104", 0.5, 8, (1.0,), (0.2,)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES_OF_COEFFICIENT_GRADIENTS)
def test_gradient_has_derivatives_of_the_loop_by_each_coefficient(case):
    system, force, name, tau, t_end, q, p = CASES_OF_COEFFICIENT_GRADIENTS[case]
    tableau, steps = nh.integrators[name], round(abs(t_end) / tau)

    def observable(q, p):
        return q[0] * p[-1] - p[0] * p[0]

    found = nh.gradient(system, name, tau, observable, t_end=t_end, q0=q, p0=p, coefficients=True)
    wanted = by_complex_steps(force, tableau, t_end / steps, steps, q, p, observable)
    for row in ("kick", "drift"):
        assert found[row].dims == (f"{row}_number",)
        scale = np.abs(wanted[row]).max()
        assert scale > 0.1
        assert found[row].values == pytest.approx(wanted[row], abs=ROUNDING * scale)


def test_members_have_their_own_derivatives_and_others_are_unchanged():
    def observable(q, p):
        return q[0] * p[1]

    given = {"t_end": 12, "q0": [[0.1, 0.3], [0.2, 0.1]], "p0": [0.2, -0.1]}
    found = nh.gradient("henon_heiles", "ruth", 0.1, observable, coefficients=True, **given)
    plain = nh.gradient("henon_heiles", "ruth", 0.1, observable, **given)
    assert (found["q0"] == plain["q0"]).all()
    assert "kick" not in plain
    assert found.kick.dims == ("member", "kick_number")
    alone = nh.gradient("henon_heiles", "ruth", 0.1, observable, coefficients=True, **given | {"q0": [0.2, 0.1]})
    assert found.kick.values[1] == pytest.approx(alone.kick.values, abs=1e-13)


def test_diverged_run_has_no_derivatives():
    found = nh.gradient("henon_heiles", "leapfrog", 3.0, lambda q, p: q[0], t_end=300, coefficients=True)
    assert found.status == "diverged"
    assert np.isnan(found.kick).all()
    assert np.isnan(found.drift).all()


@pytest.mark.parametrize(("name", "what"), [("gauss16", "it has no kicks"), ("chin_4a", "it has no kicks")])
def test_methods_without_plain_kicks_are_refused(name, what):
    with pytest.raises(SettingError, match=what):
        nh.gradient("sho", name, 0.1, lambda q, p: q[0], t_end=10, coefficients=True)


def test_runs_too_long_for_memory_are_refused(monkeypatch):
    monkeypatch.setattr(coefficients, "MOST_NUMBERS", 1000)
    with pytest.raises(SettingError, match=r"coefficients = True is not allowed: up to 62 steps here, .* not 100"):
        nh.gradient("henon_heiles", "ruth", 0.1, lambda q, p: q[0], t_end=10, coefficients=True)
