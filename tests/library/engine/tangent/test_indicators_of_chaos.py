"""Indicators of chaos against closed forms, definitions evaluated apart, and values of the literature."""

from __future__ import annotations

import re
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

import nearharmonic as nh

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
        (lambda run: run.isel(sample=[0]), {}, "start = 'a result whose last sample is not that of the run'"),
        (
            lambda run: run.drop_vars("running"),
            {},
            "start.running = 'float64 of shape (3, 2)' is not allowed: 19 finite",
        ),
        (lambda run: run, {"t_end": -3}, "t_end = '-3' is not allowed: with start=, indicators go on in the direction"),
        (lambda run: run, {"deviations": 3}, "deviations = 3 is not allowed: those of start= go on, 2 in number"),
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
