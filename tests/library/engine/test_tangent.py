"""Tangent maps against closed forms, differences in extended precision, and steps with their Jacobians in mpmath."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.math import cos, sin

EPS = 2.0**-52


def driven(q, t, k, a):
    return -k * cos(q[0]) + a * q[0] * sin(t)


def quartic(q, k):
    return k * (q[0] * q[0] * q[0] * q[0] + q[1] * q[1]) / 4 + q[0] * q[1] / 3


def relativistic(p, k):
    return nh.math.sqrt(1 + p[0] * p[0] + p[1] * p[1]) + k * p[0] * p[1] / 8


DRIVEN = nh.System(
    name="driven", V=driven, q0=["1"], p0=["0.2"], t_end="6", parameters={"k": "1.5", "a": "0.3"}, time_dependent=True
)
GENERAL = nh.System(
    name="general", V=quartic, T=relativistic, q0=["1", "0.2"], p0=["0.1", "0.4"], t_end="6", parameters={"k": "1.25"}
)
SYSTEMS = {"henon_heiles": (0.5, 20), "kepler": (30, 3000), DRIVEN: (0.2, 6), GENERAL: (0.2, 6)}


def tangent_map(run):
    """The matrix whose columns are the images of the unit vectors, from which the run began."""
    directions = np.concatenate([run.deviation_q, run.deviation_p], axis=1)
    return (directions * np.exp(run.growth.values[-1])[:, None]).T


def symplectic_form(d):
    return np.block([[np.zeros((d, d)), np.eye(d)], [-np.eye(d), np.zeros((d, d))]])


def whole_map(system, method, tau, t_end, **settings):
    dimension = (system if isinstance(system, nh.System) else nh.systems[system]).dimension
    run = nh.tangent(system, method, tau, t_end=t_end, deviations=np.eye(2 * dimension), **settings)
    return tangent_map(run), run


def differences(system, method, tau, t_end, **settings):
    """Central differences of the map, with steps of 1e-10: truncation errors of 1e-20, and roundings of 1e-31/1e-10."""
    system = system if isinstance(system, nh.System) else nh.systems[system]
    h, d, columns = Fraction(1, 10**10), system.dimension, []

    def end(state):
        run = nh.integrate(
            system, method, tau, t_end=t_end, q0=state[:d], p0=state[d:], precision="extended", energy="none",
            samples=2, **settings,
        )  # fmt: skip
        parts = [run[name].values[-1] for name in ("q", "p", "q_low", "p_low")]
        return np.concatenate(parts[:2]), np.concatenate(parts[2:])

    start = [Fraction(x) for x in (*system.q0, *system.p0)]
    for i in range(2 * d):
        up, down = (end([x + sign * h * (i == j) for j, x in enumerate(start)]) for sign in (1, -1))
        columns.append(((up[0] - down[0]) + (up[1] - down[1])) / (2 * float(h)))
    return np.array(columns).T


@pytest.mark.parametrize("method", ["ruth", "babps8o7h", "mclachlan_atela_3", "chin_4a"])
def test_oscillators_tangent_map_is_a_power_of_its_step(method):
    """The step is a product of shears; a kick of the modified potential of q^2/2 has k tau - 2 m tau^3."""
    method = {**integrators, **nh.modified_integrators}[method]
    tau, steps = 0.25, 40
    step = np.eye(2)
    kicks, drifts = iter(zip(method.kick, method.square or ["0"] * len(method.kick), strict=True)), iter(method.drift)
    for i in range(len(method.kick) + len(method.drift)):
        if (i % 2 == 0) == (method.first == "kick"):
            k, m = map(float, next(kicks))
            step = np.array([[1, 0], [-(k * tau - 2 * m * tau**3), 1]]) @ step
        else:
            step = np.array([[1, float(next(drifts)) * tau], [0, 1]]) @ step
    found, run = whole_map("sho", method, tau, tau * steps)
    assert run.steps.item() == steps
    # Some ten roundings a step, of numbers near 1.
    np.testing.assert_allclose(found, np.linalg.matrix_power(step, steps), rtol=0, atol=10 * steps * EPS)


@pytest.mark.slow
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda one: getattr(one, "name", one))
def test_tangent_map_is_symplectic_to_rounding(system):
    """Each entry of M^T J M is a sum of 2 d products of columns; M errs by a few roundings a step."""
    tau, t_end = SYSTEMS[system]
    M, run = whole_map(system, "babps8o7h", tau, t_end)
    d = len(M) // 2
    form = symplectic_form(d)
    size = np.abs(M).T @ np.abs(form) @ np.abs(M)
    assert (np.abs(M.T @ form @ M - form) <= run.steps.item() * EPS * size).all()
    bound = run.steps.item() * EPS * np.abs(M).max() ** 2 * len(M)
    assert abs(np.linalg.det(M) - 1) < bound < 1e-4


@pytest.mark.parametrize("method", ["ruth", "babps8o7h"])
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda one: getattr(one, "name", one))
def test_tangent_map_is_the_derivative_of_the_discrete_map(system, method):
    tau, t_end = SYSTEMS[system]
    found, run = whole_map(system, method, tau / 2, t_end)
    expected = differences(system, method, tau / 2, t_end)
    # Roundings of the steps, relative to each column.
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=run.steps.item() * EPS * scale)


def test_tangent_map_of_an_implicit_method_is_symplectic():
    """A step of Gauss collocation errs by the rounding of its sums over 16 forces; iterations err by less."""
    M, run = whole_map("henon_heiles", "gauss16", 0.5, 20)
    fine, _ = whole_map("henon_heiles", "babps8o7h", 0.05, 20)
    form, size = symplectic_form(2), np.abs(M).T @ np.abs(symplectic_form(2)) @ np.abs(M)
    assert (np.abs(M.T @ form @ M - form) <= 16 * run.steps.item() * EPS * size).all()
    # The error of the splitting method, of order 8 and at most 1e-7 at ten times the step.
    np.testing.assert_allclose(M, fine, rtol=0, atol=1e-9)
    assert run.evaluations.item() > 4 * 16 * run.steps.item()
    assert run.attrs["integrator"] == "gauss16"


def test_rescaling_does_not_change_the_tangent_map():
    often, once = (whole_map("henon_heiles", "babps8o7h", 0.5, 45, samples=n)[0] for n in (91, 2))
    np.testing.assert_allclose(often, once, rtol=0, atol=100 * EPS * np.abs(once).max())


def test_extended_precision_keeps_the_orbit():
    settings = {"t_end": 300, "samples": 7}
    found = nh.tangent("henon_heiles", "babps8o7h", 0.5, precision="extended", **settings)
    alone = nh.integrate("henon_heiles", "babps8o7h", 0.5, precision="extended", **settings)
    # 600 steps with roundings of 1e-32, which grow by 1e7 or so: no double differs.
    np.testing.assert_array_equal(found.q, alone.q)
    np.testing.assert_array_equal(found.p, alone.p)


def test_processed_methods_have_the_derivative_of_processed_states():
    """Differences of doubles: steps of 1e-5 err by 1e-10 of a third derivative, and by 1e-16 over 1e-5."""
    method = next(name for name, one in nh.modified_integrators.items() if one.processed)
    found, _ = whole_map("henon_heiles", method, 0.2, 4)
    h, columns = 1e-5, []
    for i in range(4):
        ends = []
        for sign in (1, -1):
            state = np.array([0.3, 0.0, 0.0, 0.4])
            state[i] += sign * h
            run = nh.integrate("henon_heiles", method, 0.2, t_end=4, q0=state[:2], p0=state[2:], samples=2)
            ends.append(np.concatenate([run.q.values[-1], run.p.values[-1]]))
        columns.append((ends[0] - ends[1]) / (2 * h))
    np.testing.assert_allclose(found, np.array(columns).T, rtol=0, atol=1e-8)


def test_members_have_the_bits_of_single_runs():
    q0, p0 = [[0, 0.1], [0, -0.15], [0.3, 0]], [[0.4, 0.1], [0.49, 0], [0, 0.4]]
    settings = {"t_end": 300, "samples": 5, "deviations": 3}
    many = nh.tangent("henon_heiles", "aba104", 0.5, q0=q0, p0=p0, **settings)
    assert many.sizes["member"] == 3
    assert many.identical(nh.tangent("henon_heiles", "aba104", 0.5, q0=q0, p0=p0, threads=2, **settings))
    for i in range(3):
        one = nh.tangent("henon_heiles", "aba104", 0.5, q0=q0[i], p0=p0[i], **settings)
        assert "member" not in one.dims
        for name in one.data_vars:
            expected = many[name].isel(member=i) if "member" in many[name].dims else many[name]
            np.testing.assert_array_equal(one[name], expected)


def test_members_may_differ_in_their_parameters():
    k = [1.0, 1.5, 2.0]
    many = nh.tangent(DRIVEN, "leapfrog", 0.2, t_end=6, parameters={"k": k}, deviations=np.eye(2))
    assert many.parameter_k.values.tolist() == k
    for i, value in enumerate(k):
        one = nh.tangent(DRIVEN, "leapfrog", 0.2, t_end=6, parameters={"k": value}, deviations=np.eye(2))
        np.testing.assert_array_equal(many.growth[i], one.growth)


def test_runs_backwards_have_the_inverse_tangent_map():
    forth, run = whole_map("henon_heiles", "babps8o7h", 0.5, 20)
    back = nh.tangent(
        "henon_heiles", "babps8o7h", 0.5, t_end=-20, q0=run.q.values[-1], p0=run.p.values[-1], deviations=np.eye(4)
    )
    # Roundings of 40 steps, times the size of both maps.
    np.testing.assert_allclose(tangent_map(back) @ forth, np.eye(4), rtol=0, atol=40 * EPS * np.abs(forth).max() ** 2)


@pytest.mark.parametrize("system", ["regularised", "numba"])
def test_systems_without_second_derivatives_are_refused(system):
    if system == "numba":
        numba = pytest.importorskip("numba")
        V, grad_V = (numba.njit(f) for f in (lambda q: q[0] * q[0] / 2, lambda q: (q[0],)))
        subject = nh.System(name="numba_spring", V=V, grad_V=grad_V, q0=["1"], p0=["0"], t_end="5")
    else:
        subject = "kepler_regularised"
    for call in (nh.tangent, nh.gradient):
        arguments = [subject, "leapfrog", 0.1] + ["energy"] * (call is nh.gradient)
        with pytest.raises(nh.NearharmonicError, match=r"^system = "):
            call(*arguments)


# --- Indicators of chaos against closed forms, definitions evaluated apart, and values of the literature


#: A regular and a chaotic orbit at H = 1/8.
REGULAR = {"q0": [0, 0.55], "p0": [0.2417, 0]}
CHAOTIC = {"q0": [0, -0.25], "p0": [0.42, 0]}


def free(q):
    return 0 * q[0]


def inverted(q):
    return -q[0] * q[0] / 2


def one_coordinate(V):
    return nh.System(name=V.__name__, V=V, q0=["0"], p0=["0"], t_end="1")


def vectors(run):
    return np.concatenate([run.deviation_q, run.deviation_p], axis=1)


def test_growth_from_an_unstable_equilibrium_is_the_hyperbola():
    """From (1, 0), u = cosh t and w = sinh t; the eighth-order step errs by 1e-10 relative in this time."""
    run = nh.tangent(one_coordinate(inverted), "babps8o7h", 0.1, t_end=40, deviations=[1, 0], samples=9)
    expected = [float(mp.log(mp.cosh(2 * t)) / 2) for t in run.t.values]
    np.testing.assert_allclose(run.growth[:, 0], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.lyapunov_exponent[1:], expected[1:] / run.t.values[1:], rtol=0, atol=1e-9)
    half = nh.tangent(one_coordinate(inverted), "babps8o7h", 0.1, t_end=17, deviations=[1, 0])
    rest = nh.tangent(one_coordinate(inverted), "babps8o7h", 0.1, t_end=23, start=half, samples=9)
    expected = np.array([float(mp.log(mp.cosh(2 * t)) / 2) for t in rest.t.values])
    assert rest.t.values[[0, -1]].tolist() == [17, 40]
    np.testing.assert_allclose(rest.growth[:, 0], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(rest.lyapunov_exponent, expected / rest.t.values, rtol=0, atol=1e-9)


INDICATORS = (
    "q", "p", "q_low", "energy_error", "growth", "megno", "lyapunov_exponent", "lyapunov_spectrum", "sali", "gali",
)  # fmt: skip


@pytest.mark.parametrize("precision", ["double", "extended"])
def test_indicators_of_a_continued_run_are_those_of_one(precision):
    """In bits where both rescale at the same steps, but for the means of MEGNO: times are divided by the step."""
    how = {"deviations": 4, "precision": precision}
    starts = {"q0": [REGULAR["q0"], CHAOTIC["q0"]], "p0": [REGULAR["p0"], CHAOTIC["p0"]]}
    whole = nh.tangent("henon_heiles", "babps8o7h", 0.3, t_end=120, samples=5, **starts, **how)
    half = nh.tangent("henon_heiles", "babps8o7h", 0.3, t_end=60, samples=3, **starts, **how)
    late, half = whole.isel(sample=[2, 3, 4]), half.transpose()
    rest = nh.tangent("henon_heiles", "babps8o7h", 0.3, t_end=60, samples=3, start=half, **how)
    own = nh.tangent("henon_heiles", "babps8o7h", 0.3, t_end=60, samples=3, start=half.isel(member=1), **how)
    for name in INDICATORS:
        for found, expected in ((rest[name], late[name]), (own[name], late[name].isel(member=1))):
            np.testing.assert_allclose(found, expected, rtol=1e-13 if name == "megno" else 0, err_msg=name)
    for name in ("deviation_q", "deviation_p"):
        assert np.array_equal(rest[name], whole[name])


@pytest.mark.parametrize(
    ("change", "more", "says"),
    [
        (lambda run: run.isel(sample=[0]), {}, "start = 'a result without the last sample of the run'"),
        (
            lambda run: run.drop_vars("running"),
            {},
            "start.running = 'float64 of shape (3, 2)' is not allowed: 19 finite",
        ),
        (lambda run: run, {"t_end": -3}, "t_end = '-3' is not allowed: the sign of the time in start=: indicators"),
        (lambda run: run, {"deviations": 3}, "deviations = 3 is not allowed: 2, the number of deviations in start="),
        (lambda run: run, {"p0": [1, 1]}, "p0 = [1, 1] is not allowed: with start=, a run continues from the state"),
        (lambda run: run.assign_attrs(system="sho"), {}, "start = 'a result of sho' is not allowed"),
    ],
)
def test_deviations_that_cannot_go_on_are_refused(change, more, says):
    run = nh.tangent("henon_heiles", "ruth", 0.1, t_end=1, samples=3)
    with pytest.raises(nh.NearharmonicError, match=re.escape(says)):
        nh.tangent("henon_heiles", "ruth", 0.1, start=change(run), **{"t_end": 1} | more)


def test_spectrum_of_an_unstable_equilibrium_is_a_pair():
    """The flow stretches by e^t along (1, 1) and shrinks by e^-t; other directions differ by a constant over t."""
    run = nh.tangent(one_coordinate(inverted), "babps8o7h", 0.1, t_end=400, deviations=2)
    np.testing.assert_allclose(run.lyapunov_spectrum[-1], [1, -1], rtol=0, atol=1 / 400)


@pytest.mark.slow
def test_megno_of_a_free_particle_is_its_integral():
    """|delta|^2 = 1 + t^2, Y = 2 - 2 arctan(t)/t; trapezoids of 0.2 err by 0.04/12 of the slope over t."""
    run = nh.tangent(one_coordinate(free), "leapfrog", 0.1, t_end=100, deviations=[0, 1], samples=6)
    for t, found in zip(run.t.values[1:], run.megno.values[1:], strict=True):
        mean = mp.quad(lambda s: 2 - 2 * mp.atan(s) / s, [0, 1, t]) / t
        assert found == pytest.approx(float(mean), abs=0.04 / t)


def test_megno_of_the_oscillator_vanishes():
    """A rotation keeps all lengths; the step is a rotation to 1e-10."""
    run = nh.tangent("sho", "babps8o7h", 0.1, t_end=100)
    assert np.abs(run.megno[1:]).max() < 1e-9
    assert np.abs(run.growth).max() < 1e-9


def test_regular_orbit_has_megno_two_and_no_exponent():
    """ln|delta|/t is below (ln t + 1)/t for linear growth of rate below e."""
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=10000, deviations=3, **REGULAR)
    assert run.megno.values[-1] == pytest.approx(2, abs=0.1)
    assert 0 < run.lyapunov_exponent.values[-1] < (np.log(10000) + 1) / 10000
    assert run.sali.values.min() > 0.01


def test_chaotic_orbits_have_the_exponent_of_the_literature():
    """0.047 at H = 1/8 in studies of SALI and GALI; 2.365 is Student's t with seven degrees of freedom."""
    y = np.linspace(-0.27, -0.2, 8)
    starts = {"q0": np.stack([0 * y, y], 1), "p0": np.stack([np.sqrt(1 / 4 - y * y + 2 * y**3 / 3), 0 * y], 1)}
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=50000, deviations=1, samples=2, **starts)
    found = run.lyapunov_exponent.values[:, -1]
    half = 2.365 * found.std(ddof=1) / np.sqrt(8)
    assert abs(found.mean() - 0.047) < half < 0.005
    assert (run.lyapunov_low.values < found).all()
    assert run.megno.values[:, -1].min() > 500


def test_growth_is_that_of_two_neighbouring_orbits():
    """Benettin's distance of 1e-8, rescaled after each unit of time: it errs by 1e-8 of curvature and of rounding."""
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=200, samples=2, deviations=[1, 0, 0, 0], **CHAOTIC)
    step = nh.problem("henon_heiles", "babps8o7h", t_end=1, energy="none")
    state, distance, growth = np.array([*CHAOTIC["q0"], *CHAOTIC["p0"]], float), 1e-8, 0.0
    other = state + np.array([distance, 0, 0, 0])
    for _ in range(200):
        ends = [step(0.5, x[:2].copy(), x[2:].copy()) for x in (state, other)]
        state, other = (np.concatenate([end.q[-1], end.p[-1]]) for end in ends)
        length = np.linalg.norm(other - state)
        growth += np.log(length / distance)
        other = state + (other - state) * (distance / length)
    assert run.growth.values[-1, 0] == pytest.approx(growth, abs=200 * 1e-7)
    assert growth > 5


def test_spectrum_of_a_hamiltonian_system_is_symmetric():
    """Volumes of a symplectic map do not change: 2000 steps of roundings. Sums of pairs vanish like 1/t."""
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=1000, deviations=4, **CHAOTIC)
    rates = run.lyapunov_spectrum.values[-1]
    assert rates[0] == pytest.approx(run.lyapunov_exponent.values[-1], rel=1e-12)
    assert abs(rates.sum()) * 1000 < 2000 * 4 * 2.0**-52
    assert abs(rates[0] + rates[3]) < 10 / 1000
    assert abs(rates[1] + rates[2]) < 10 / 1000


def test_alignment_indices_are_those_of_the_final_deviations():
    """By their definitions, for vectors that are not yet parallel: Gram determinants err by roundings over them."""
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=60, deviations=4, **CHAOTIC)
    units = vectors(run)
    np.testing.assert_allclose((units * units).sum(axis=1), 1, rtol=1e-14)
    sali = min(np.linalg.norm(units[0] + units[1]), np.linalg.norm(units[0] - units[1]))
    assert run.sali.values[-1] == pytest.approx(sali, rel=1e-10)
    for k in run.order.values:
        volume = np.prod(np.linalg.svd(units[:k], compute_uv=False))
        assert run.gali.sel(order=k).values[-1] == pytest.approx(volume, rel=1e-8)


def test_default_deviations_are_orthonormal_and_nested():
    one, all_four = (nh.tangent("henon_heiles", "ruth", 1e-9, t_end=1e-9, deviations=k) for k in (1, 4))
    # One step of 1e-9 moves them by as much.
    np.testing.assert_allclose(vectors(all_four) @ vectors(all_four).T, np.eye(4), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(vectors(one), vectors(all_four)[:1])
    assert np.abs(vectors(all_four)).min() > 0.01


def test_interval_is_that_of_ten_blocks():
    """Student's t with nine degrees of freedom, 2.2622 in tables; the package's series errs by 2e-3 at most."""
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=5000, samples=11, **CHAOTIC)
    rates = np.diff(run.growth.values[:, 0]) / 500
    half = 2.2622 * rates.std(ddof=1) / np.sqrt(10)
    assert run.lyapunov_high.item() - run.lyapunov_low.item() == pytest.approx(2 * half, rel=3e-3)
    assert (run.lyapunov_high + run.lyapunov_low).item() / 2 == pytest.approx(rates.mean(), rel=1e-12)


def test_energy_errors_are_those_of_the_orbit():
    found = nh.tangent("henon_heiles", "ruth", 0.1, t_end=100, samples=11)
    alone = nh.integrate("henon_heiles", "ruth", 0.1, t_end=100, samples=11)
    # Energies of 1/8 in doubles, of terms up to 1/2.
    np.testing.assert_allclose(found.energy_error, alone.energy_error, rtol=0, atol=1e-13)
    assert found.max_energy_error.item() == np.abs(found.energy_error).max()


def test_diverged_member_ends_and_others_go_on():
    starts = {"q0": [[0, 0.1], [3, 3]], "p0": [[0.4, 0.1], [1, 1]]}
    run = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=100, **starts)
    assert run.status.values.tolist() == ["ok", "diverged"]
    assert run.diverged_at.values[0] == 0 < run.diverged_at.values[1]
    assert np.isinf(run.max_energy_error.values[1])
    for name in ("lyapunov_exponent", "growth", "megno", "sali", "q"):
        assert np.isnan(run[name].values[1, -1]).all(), name
        assert np.isfinite(run[name].values[0, -1]).all(), name
    assert np.isnan(run.lyapunov_low.values).tolist() == [False, True]


def test_divergence_between_samples_is_seen():
    """Deviations grow with the orbit, and are infinite a few steps apart from it."""
    starts = {"q0": [3, 3], "p0": [1, 1], "t_end": 100}
    found = nh.tangent("henon_heiles", "babps8o7h", 0.5, samples=2, **starts)
    alone = nh.integrate("henon_heiles", "babps8o7h", 0.5, energy="none", samples=201, **starts)
    assert abs(found.diverged_at.item() - alone.sizes["sample"]) <= 2
    assert alone.sizes["sample"] < 100


def test_one_sample_is_the_end():
    last = nh.tangent("henon_heiles", "ruth", 0.1, t_end=10, samples=1)
    both = nh.tangent("henon_heiles", "ruth", 0.1, t_end=10, samples=2)
    assert last.t.values.tolist() == [10]
    np.testing.assert_array_equal(last.growth[0], both.growth[1])
    assert last.sizes["sample"] == 1


def test_evaluations_are_those_of_all_lanes_and_parts():
    """Leapfrog kicks first: a force a step, and one more at the start of each of two parts of 75 steps."""
    run = nh.tangent("henon_heiles", "leapfrog", 0.1, t_end=15, samples=2, deviations=3)
    assert run.evaluations.item() == 3 * (150 + 2)


def test_samples_do_not_change_the_exponent_or_megno():
    """Rescaling rounds each length; MEGNO is read at the same times but for a few."""
    runs = [nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=400, samples=n, **REGULAR) for n in (2, 5, 41)]
    for one, other in pairwise(runs):
        assert one.growth.values[-1, 0] == pytest.approx(other.growth.values[-1, 0], abs=1e-11)
        assert one.megno.values[-1] == pytest.approx(other.megno.values[-1], abs=0.01)
