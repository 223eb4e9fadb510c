"""Runs of the stress tests against single runs, multiprecision, other units, and data with known answers."""

from dataclasses import replace
from fractions import Fraction
from math import atan2, hypot, log, pi, sqrt

import numpy as np
import pytest
import xarray as xr
from mpmath import findroot, mpf

import nearharmonic as nh
from nearharmonic.core.arithmetic import sqrt as any_sqrt
from nearharmonic.engine import batch, kernels
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.numerics.portable import quasi_random
from nearharmonic.output.store import assembled
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability import reductions, run
from nearharmonic_paper.experiments.stability import run as conservation
from nearharmonic_paper.experiments.stability import run as maps
from nearharmonic_paper.experiments.stability import run as rounding
from nearharmonic_paper.experiments.stability import settings as sizes
from nearharmonic_paper.experiments.stability.reductions import OF_ROUNDING as reduction
from nearharmonic_paper.experiments.stability.run import henon_heiles_surface, kepler_apoapsis
from nearharmonic_paper.experiments.stability.run import kinetic_energy_measure as measure
from support.oracles.multiprecision import trajectory
from support.oracles.structures import runs_of, structure

# --- Initial conditions against the recurrence in multiprecision, the energy's own formula, and quadrature.


SURFACES = [Fraction(1, 24), Fraction(1, 12), Fraction(1, 8), Fraction(1, 6)]


def potential(x, y):
    return 0.5 * (x**2 + y**2) + x**2 * y - y**3 / 3


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_points_follow_the_recurrence_of_the_generalised_golden_ratio(dimension):
    points = quasi_random(1000, dimension, seed=3)
    phi = findroot(lambda x: x ** (dimension + 1) - x - 1, 1.5)
    for k in range(dimension):
        for n in (1, 10, 999):
            expected = (mpf(points[0, k]) + n * phi ** -(k + 1)) % 1
            # Points are cut to 53 bits, alpha is odd in the 64th: 2^-53 at either end, n 2^-63 between.
            assert abs(points[n, k] - expected) < mpf(2) ** -52 + n * mpf(2) ** -62


def test_same_seed_gives_same_points_and_another_seed_others():
    assert np.array_equal(quasi_random(50, 3, 7), quasi_random(50, 3, 7))
    assert np.array_equal(quasi_random(50, 3, 7), quasi_random(80, 3, 7)[:50])
    assert np.abs(quasi_random(50, 3, 7) - quasi_random(50, 3, 8)).min() > 1e-6


def test_points_fill_the_interval_more_evenly_than_random_ones():
    """Star discrepancy of 4096 points: random ones have 0.9/sqrt(n) = 0.013, the recurrence a few log(n)/n = 0.002."""
    points = np.sort(quasi_random(4096, 3, 1), axis=0)
    rank = np.arange(4096)[:, None]
    discrepancy = np.maximum((rank + 1) / 4096 - points, points - rank / 4096).max(axis=0)
    assert (points >= 0).all()
    assert (points < 1).all()
    assert discrepancy.max() < 0.004


@pytest.mark.parametrize("energy", SURFACES)
def test_starts_lie_on_the_bounded_part_of_their_energy_surface(energy):
    x, y, _, _, u, v, _, _ = henon_heiles_surface(energy, 2000, 1).T
    # H is a sum of a dozen terms below 1/2, each rounded: 12 * 1.1e-16 / 2.
    assert np.abs((u**2 + v**2) / 2 + potential(x, y) - float(energy)).max() < 7e-16
    # The triangle of the saddle points (0, 1), (+-sqrt(3)/2, -1/2).
    assert (y >= -0.5).all()
    assert (np.sqrt(3) * np.abs(x) <= 1 - y).all()


@pytest.mark.parametrize("energy", SURFACES)
def test_starts_have_the_microcanonical_measure(energy):
    """Moments of q by quadrature over the area V < H, a midpoint rule of 1e6 cells; directions by Fourier's modes."""
    x, y, _, _, u, v, _, _ = henon_heiles_surface(energy, 4096, 1).T
    side = np.linspace(-1, 1, 1001)[:-1] + 1 / 1000
    X, Y = np.meshgrid(side, side)
    inside = (potential(X, Y) < float(energy)) & (Y > -0.5) & (np.sqrt(3) * np.abs(X) < 1 - Y)
    for moment in (lambda x, y: x**2, lambda x, y: y**2, potential):
        expected = moment(X, Y)[inside].mean()
        # Random points would miss by 1/sqrt(4096) = 1.6 %; quasi-random ones by ten times less.
        assert moment(x, y).mean() == pytest.approx(expected, rel=4e-3)
    angle = np.arctan2(v, u)  # random directions would average to 1/sqrt(4096) = 0.016
    for mode in (1, 2, 3):
        assert abs(np.exp(1j * mode * angle).mean()) < 8e-3
        assert abs((np.exp(1j * mode * angle) * y).mean()) < 8e-3


def test_kepler_orbits_start_at_apoapsis_with_requested_eccentricity():
    e, orientation = np.array([0.0, 0.3, 0.99]), np.array([0.0, 1.0, 4.0])
    x, y, _, _, u, v, _, _ = kepler_apoapsis(e, orientation).T
    r = np.hypot(x, y)
    assert (u**2 + v**2) / 2 - 1 / r == pytest.approx(-0.5, rel=1e-14)
    assert r == pytest.approx(1 + e, rel=1e-15)
    assert x * u + y * v == pytest.approx(0, abs=1e-15)
    assert x * v - y * u == pytest.approx(np.sqrt(1 - e**2), rel=1e-14)
    assert np.arctan2(y, x) % (2 * np.pi) == pytest.approx(orientation, abs=1e-15)


# --- The Kepler map against steps in multiprecision, other units, and synthetic data with known answers.


def dataset(contents):
    """The contents of a run file, as they are read from it."""
    return xr.Dataset(contents["run"].variables)


MAP = sizes.MapSettings(
    eccentricities=8,
    highest_eccentricity=0.9,
    orbits=4,
    evaluations_per_orbit=sizes.EvaluationsGrid(lowest=20.0, highest=5000.0, points_per_decade=10),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["ruth", "babs7o7h"])
def test_cell_of_kepler_map_is_what_plain_integrator_finds(integrator):
    """Both round differently, by 1e-16 a step: 1e-12 over a thousand steps, of errors above 1e-4."""
    e, steps, orbits = 0.6, 300, 4
    tableau = nh.integrators[integrator]
    paths = maps.orbit_runs(tableau, steps, orbits, np.array([e]))
    units = replace(nh.systems["kepler"], parameters={"GM": replace(nh.systems["kepler"].parameters["GM"], value="1")})
    start = [mpf(1 + e), mpf(0)], [mpf(0), mpf(sqrt((1 - e) / (1 + e)))]
    _, *run = trajectory(tableau, units, mpf(2 * pi / steps), steps * orbits, start)
    states = [[float(x) for x in (*q, *p)] for q, p in run]
    errors = [abs((u * u + v * v) / 2 - 1 / hypot(x, y) + 0.5) * 2 for x, y, u, v in states]
    assert paths.max_energy_error[0] == pytest.approx(max(errors), rel=1e-7)
    angles = [pi]  # the perihelion lies opposite to the start
    for x, y, u, v in states[steps - 1 :: steps]:
        L, r = x * v - y * u, hypot(x, y)
        angles.append(atan2(-u * L - y / r, v * L - x / r) % (2 * pi))
    slope = np.polyfit(range(orbits + 1), angles, 1)[0]
    assert reductions.rotation_per_sample(paths.q, paths.p)[0] == pytest.approx(slope, rel=1e-6)


def test_units_of_orbit_and_those_of_mercury_give_same_error():
    """e from NSSDC's aphelion and slowest speed; the two runs round differently, by 1e-15 of an error of 1e-4."""
    kepler = nh.systems["kepler"]
    r, v, GM = float(kepler.q0[0]), float(kepler.p0[1]), float(kepler.parameters["GM"].value)
    a = 1 / (2 / r - v**2 / GM)
    period = 2 * pi * sqrt(a**3 / GM)
    mercury = nh.sweep("kepler", "aba864", [period / 20], t_end=4 * period)
    ours = maps.orbit_runs(nh.integrators["aba864"], 20, 4, np.array([r / a - 1]))
    assert mercury.steps.item() == 80
    assert ours.max_energy_error[0] == pytest.approx(mercury.max_energy_error.item(), rel=1e-9)


@pytest.mark.parametrize("rate", [1e-9, -1e-3, 0.7, -1.5])
def test_advance_is_rate_at_which_ellipse_is_turned(rate):
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), rate * np.arange(9)).T
    advance = reductions.rotation_per_sample(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])
    assert advance[0] == pytest.approx(rate, rel=1e-12, abs=1e-15)


def test_ellipse_that_turns_by_more_than_quarter_has_no_advance():
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), 1.6 * np.arange(9)).T
    assert np.isnan(reductions.rotation_per_sample(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])[0])


def test_orbits_that_are_not_run_would_err_less_than_floor():
    tableau = nh.integrators["yoshida_s7o6a"]
    result = dataset(maps.kepler_measure("yoshida_s7o6a", MAP))
    skipped = np.argwhere(np.isnan(result.energy_error.values))
    assert len(skipped)
    for j in set(skipped[:, 1]):
        assert (result.energy_error[:, j] < maps.FLOOR).sum() == 2
    for i, j in skipped[::4]:
        one = maps.orbit_runs(tableau, int(result.steps_per_orbit[i]), MAP.orbits, result.eccentricity.values[[j]])
        assert one.max_energy_error[0] < maps.FLOOR


def test_map_separates_lost_from_kept_orbits_and_circles_from_ellipses():
    measured = dataset(maps.kepler_measure("ruth", MAP))
    result = reductions.kepler_cube(reductions.stacked(["ruth"], [measured])).isel(integrator=0)
    lost = np.isinf(result.energy_error)
    assert lost.any()
    assert (result.orbits_kept.where(lost, drop=True) < MAP.orbits).any()
    assert (result.orbits_kept.where(~lost & result.energy_error.notnull(), MAP.orbits) == MAP.orbits).all()
    assert not lost.isel(tau_per_stage=-1, eccentricity=0)
    assert result.perihelion_advance.sel(eccentricity=0).isnull().all()
    assert result.perihelion_advance.isel(tau_per_stage=-1, eccentricity=4).notnull()
    assert result.eccentricity.values[[0, -1]].tolist() == pytest.approx([0, 0.9])
    assert np.diff(np.log(1 - result.eccentricity)) == pytest.approx(log(0.1) / 7)


def test_contour_of_power_law_is_where_algebra_puts_it():
    """100 n^-4 meets 1e-6 at n = 1e2; from 1e9 n^-4 on the curve never does; what is not run counts as below."""
    n = np.array([10.0, 30.0, 90.0, 300.0, 1000.0])
    error = np.stack([100 * n**-4, 1e9 * n**-4, np.where(n > 200, np.nan, 100 * n**-4)], axis=1)
    error[0, 0] = np.inf
    found = [reductions.evaluations_below(n, column, 1e-6) for column in error.T]
    assert found[0] == pytest.approx(100, rel=1e-12)
    assert np.isnan(found[1])
    assert found[2] == pytest.approx(300, rel=1e-12)
    dip = np.array([1e-7, 1e-3, 1e-7, 1e-5, 1e-9])  # a dip below the level is not yet the end
    assert reductions.evaluations_below(n, dip, 1e-6) == pytest.approx(300 * (10 / 3) ** 0.25, rel=1e-12)


# --- Ensembles against single runs, other units, synthetic data with known answers, and an integrator written here.


def looked_at(integrator, tau, start, samples=2, **how):
    """Runs of ``start`` at one step size, looked at as the ensembles are."""
    steps, look = run.henon_heiles_schedule(Fraction(100), tau)
    numerics = Numerics(**{"energy": "samples", "look": look, **how})
    return integrate_batch(
        nh.systems["henon_heiles"], nh.integrators[integrator], t_end=steps * tau, steps=[steps] * len(start),
        samples=samples, numerics=numerics, start=start,
    )  # fmt: skip


@pytest.mark.parametrize("tau", [Fraction(7, 20), Fraction(22, 10), Fraction(45, 10)])
def test_looks_divide_run_without_change_of_step_or_interval(tau):
    steps, look = run.henon_heiles_schedule(Fraction(250), tau)
    assert steps % look == 0
    assert 250 <= steps * tau < 250 + look * tau
    assert steps // look >= run.LOOKS - 5


@pytest.mark.parametrize("tau", [Fraction(1, 2), Fraction(11, 4)])
def test_trajectory_in_ensemble_is_trajectory_alone_bit_for_bit(monkeypatch, tau):
    """At the larger step size about half of them escape, so that lanes are refilled at different times."""
    start = henon_heiles_surface(Fraction(1, 6), 200, 1)
    widths = []
    monkeypatch.setattr(
        batch, "kernel_of", lambda *asked, **how: widths.append((found := kernel_of(*asked, **how)).width) or found
    )
    together = looked_at("aba864", tau, start, width=16)
    alone = looked_at("aba864", tau, start[37::23], width=1)
    assert widths == [16, 1]
    assert (together.left_at > 0).any() == (tau > 1)
    assert np.array_equal(together.max_energy_error[37::23], alone.max_energy_error)
    assert np.array_equal(together.left_at[37::23], alone.left_at)
    assert np.array_equal(together.q[37::23], alone.q, equal_nan=True)


def test_looks_measure_energy_only_at_their_instants():
    """Sampled at the same instants, a run that measures every step has the same errors; between them are larger ones.

    Of 25 looks at an error that swings, the largest reaches half of its amplitude in nearly every run.
    """
    start = henon_heiles_surface(Fraction(1, 12), 64, 1)
    tau = Fraction(7, 10)
    steps, look = run.henon_heiles_schedule(Fraction(100), tau)
    looks = looked_at("aba864", tau, start)
    every = looked_at("aba864", tau, start, energy="every", look=None, samples=steps // look + 1)
    assert (np.diff(every.marks, axis=1) == look).all()
    assert np.array_equal(looks.max_energy_error, np.abs(every.energy_error).max(axis=1))
    assert (looks.max_energy_error < every.max_energy_error).mean() > 0.5
    assert np.median(looks.max_energy_error / every.max_energy_error) > 0.5
    assert np.isnan(looks.mean_energy_error).all()
    assert (every.mean_energy_error > 0).all()


def test_all_escape_beyond_last_linear_limit_none_at_its_tenth():
    """Ruth's steps are unstable for good beyond tau = 1.573401947, of which the origin's neighbourhood knows all."""
    start = np.concatenate([henon_heiles_surface(Fraction(1, part), 100, 1) for part in (24, 6)])
    beyond = run.integrate_ensemble(nh.integrators["ruth"], Fraction("1.6"), Fraction(250), start, surfaces=2)
    assert beyond.escaped.tolist() == [1.0, 1.0]
    assert np.isinf(beyond.quantiles).all()
    below = run.integrate_ensemble(nh.integrators["ruth"], Fraction("0.16"), Fraction(250), start, surfaces=2)
    assert below.escaped.tolist() == [0.0, 0.0]
    assert (np.diff(below.quantiles, axis=1) >= 0).all()
    assert np.isfinite(below.quantiles).all()
    # The force is taken three times a step by those that escape as by those that stay; the first stop early.
    assert below.evaluations == 3 * 200 * below.steps
    assert beyond.evaluations < 3 * 200 * beyond.steps


@pytest.mark.parametrize(("tau", "escapes"), [(Fraction(1, 2), False), (Fraction(21, 10), True)])
def test_quantiles_and_fraction_are_those_of_the_sorted_runs(tau, escapes):
    """The quantile f of 30 errors is the smallest that a fraction f of them does not exceed."""
    start = henon_heiles_surface(Fraction(1, 6), 30, 1)
    result = run.integrate_ensemble(nh.integrators["aba864"], tau, Fraction(100), start, surfaces=1)
    errors = looked_at("aba864", tau, start).max_energy_error
    assert (result.escaped[0] > 0) == escapes
    assert result.escaped[0] == np.isinf(errors).mean()
    expected = [min(e for e in errors if (errors <= e).mean() >= f) for f in run.QUANTILES]
    assert result.quantiles[0].tolist() == expected


def test_ensemble_map_is_bitwise_reproducible_and_depends_on_seed():
    grid = sizes.EvenStepSizes(lowest="0.2", highest="0.3", spacing="0.1")
    settings = {"trajectories": 20, "energies": ("1/12",), "t_end": "20", "tau_per_stage": grid}
    first, again, other = (
        dataset(run.henon_heiles_measure("ruth", sizes.EnsembleSettings(**settings, seed=seed))) for seed in (1, 1, 2)
    )
    assert first.identical(again)
    assert not np.array_equal(first.energy_error, other.energy_error)
    assert first.tau_per_stage.values.tolist() == [0.2, 0.3]


@pytest.mark.slow
def test_warming_up_compiles_what_the_runs_use():
    for ensemble, uses in (
        ("henon_heiles", [("henon_heiles", "double", "compensated", "samples")]),
        ("kepler", [("kepler", "double", "compensated", "every")]),
        (
            "rounding",
            [
                ("kepler", p, s, "samples")
                for p, s in (("double", "plain"), ("double", "compensated"), ("extended", "compensated"))
            ],
        ),
    ):
        kernel_of.cache_clear()
        assert run.warm_up(ensemble) == {}
        before = kernel_of.misses
        for system, precision, summation, energy in uses:
            problem = nh.systems["henon_heiles"] if system == "henon_heiles" else run.SYSTEM
            how = {"precision": precision, "summation": summation, "width": run.WIDTH, "energy": energy}
            kernel_of(problem, Numerics(**how))
        assert kernel_of.misses == before


# --- Lost digits: Brouwer's powers in every arithmetic, and synthetic random walks whose exponent is known.


LONG = sizes.RoundingSettings(ensemble=32, steps=40_000, evaluations_per_orbit=400, seed=1)


@pytest.fixture(scope="module")
def lost_digits():
    return dataset(rounding.rounding_measure("aba104", LONG))


def law(result, source, variable):
    found = reduction.of(result, over="orbit").sel(source=source).isel(sample=-1)
    return {key: found[f"{variable}_{key}"].item() for key in ("exponent", "interval", "rms", "bias")}


@pytest.mark.slow
def test_rounding_grows_as_brouwer_says_in_every_arithmetic(lost_digits):
    """The 95 % interval, and half as much again because six exponents are tested at once."""
    for source in ("plain", "compensated", "extended"):
        for variable, exponent in (("energy_error", 0.5), ("lag", 1.5)):
            one = law(lost_digits, source, variable)
            assert one["interval"] < 0.2
            assert abs(one["exponent"] - exponent) < 1.5 * one["interval"]
            assert one["bias"] < 0.75 * one["rms"]  # four standard errors, 1/sqrt(32), of a mean without bias


def test_compensation_gains_order_of_magnitude_and_double_double_its_digits(lost_digits):
    """Unit roundoff is 2^-53 and 2^-106 or so: 16 digits apart, of which a random walk of 1e5 operations keeps 14."""
    rms = {source: law(lost_digits, source, "energy_error")["rms"] for source in rounding.SOURCES}
    assert rms["plain"] > 10 * rms["compensated"]
    assert rms["compensated"] > 1e13 * rms["extended"]
    assert rms["extended"] > 1e-32


def test_rounded_coefficients_alone_shift_the_phase_in_proportion_to_time(lost_digits):
    one = law(lost_digits, "coefficients", "lag")
    assert one["exponent"] == pytest.approx(1, abs=0.01)
    assert one["rms"] > 1e-15


def test_coefficients_that_are_doubles_shift_nothing():
    """Leapfrog's 1/2 and 1 times a period over 64 are doubles: what is left is the rounding of double-double."""
    settings = sizes.RoundingSettings(ensemble=3, steps=2000, evaluations_per_orbit=64, seed=1)
    assert np.abs(dataset(rounding.rounding_measure("leapfrog", settings)).lag.sel(source="coefficients")).max() < 1e-25


def test_the_scaled_orbit_is_the_same_orbit():
    """Lengths times 9 and momenta over 3 leave the eccentricity; H/9 to the rounding of double-double, 2^-105."""
    start = rounding.rounding_starts(LONG)
    scaled = rounding._scaled(start)
    for row, large in zip(start[:4], scaled[:4], strict=True):
        for k, factor in ((0, 9), (1, 9), (4, Fraction(1, 3)), (5, Fraction(1, 3))):
            exact = Fraction(row[k]) * factor
            assert abs(Fraction(large[k]) + Fraction(large[k + 2]) - exact) <= abs(exact) / 2**105


def test_errors_are_those_that_were_put_in():
    """A run moved by 1e-9 along its velocity lags by 1e-9 over its speed; a faster one has p dp more energy."""
    from dataclasses import replace

    paths = integrate_batch(
        maps.SYSTEM, nh.integrators["ruth"], t_end=Fraction(6), steps=[60], samples=2,
        start=kepler_apoapsis(np.array([0.3])),
    )  # fmt: skip
    q, p = paths.q[0, -1], paths.p[0, -1]
    speed = float(np.hypot(*p))
    moved, faster = paths.q.copy(), paths.p.copy()
    moved[0, -1] += 1e-9 * p / speed
    faster[0, -1] *= 1 + 1e-9
    last = np.array([1])
    energy, lag = rounding.errors(rounding.states(replace(paths, q=moved), last), rounding.states(paths, last))
    assert lag[0, 0] == pytest.approx(1e-9 / speed, rel=1e-6)  # 1e-16 of q in a step of 1e-9
    assert energy[0, 0] == pytest.approx(2 * 1e-9 * float(q @ p) / speed / float(np.hypot(*q)) ** 3, rel=1e-5)
    energy, lag = rounding.errors(rounding.states(replace(paths, p=faster), last), rounding.states(paths, last))
    assert energy[0, 0] == pytest.approx(2e-9 * speed**2, rel=1e-6)
    assert lag[0, 0] == 0


@pytest.mark.parametrize("stages", [1, 3, 9])
def test_samples_of_long_runs_are_whole_periods_apart(stages):
    settings = sizes.RoundingSettings(ensemble=3, steps=1_000_000, evaluations_per_orbit=400, seed=1)
    plan = rounding.rounding_schedule(settings, stages)
    per_orbit = round(400 / stages)
    assert plan.samples == rounding.ROUNDING_SAMPLES
    assert plan.steps == plan.periods * per_orbit
    assert plan.periods % plan.samples == 0
    assert 1_000_000 <= plan.steps < 1_000_000 + per_orbit * plan.samples


# --- Structure against multiprecision, systems that lack it, and closed forms; other kinetic energies by the conjugate.


def tangent_in_multiprecision(system, tableau, tau, steps):
    """Central differences of the last state, by each coordinate of the first: off by the square of the spacing."""
    spacing, start = mpf(10) ** -20, [*map(mpf, (*system.q0, *system.p0))]
    columns = []
    for i in range(len(start)):
        ends = []
        for sign in (1, -1):
            moved = [x + sign * spacing * (i == j) for j, x in enumerate(start)]
            half = len(moved) // 2
            q, p = trajectory(tableau, system, mpf(tau), steps, (moved[:half], moved[half:]))[-1]
            ends.append([*q, *p])
        columns.append([float((a - b) / (2 * spacing)) for a, b in zip(*ends, strict=True)])
    return np.transpose(columns)


@pytest.mark.slow
@pytest.mark.parametrize("system", ["sho", "henon_heiles", "kepler", "relativistic_oscillator"])
@pytest.mark.parametrize("name", ["ruth", "babs7o7h"])
def test_the_tangent_map_is_that_of_multiprecision(monkeypatch, system, name):
    problem, tableau, steps = systems[system], integrators[name], 20
    t_end = Fraction(problem.t_end) / 200
    monkeypatch.setattr(conservation, "EVALUATIONS", 25 * steps * tableau.stages)
    one = runs_of(problem, [tableau], 25 * t_end).isel(integrator=0, sample=steps)
    J, scales = reductions.tangent_map(one.neighbour.values, one.neighbour_low.values, 2.0**-24), one.scale.values
    expected = tangent_in_multiprecision(problem, tableau, float(t_end / steps), steps) * scales / scales[:, None]
    # Doubles of coefficients and of the step are off by 1e-16 in each of a few hundred substeps.
    assert np.abs(np.array(J, dtype=float) - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("J", "expected"), [([[1, 0], [0, 1]], 0), ([[2, 5], [0, Fraction(1, 2)]], 0), ([[2, 0], [0, 1]], 1)]
)
def test_matrix_defect_in_one_dimension_is_that_of_determinant(J, expected):
    assert reductions.defect(np.array(J, dtype=object)) == expected


def test_the_defect_sees_degrees_of_freedom_that_are_mixed_up():
    # A turn of the positions alone: areas go from (q1, p1) to (q2, p1).
    J = [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert reductions.defect(np.array(J, dtype=object)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("system", ["sho", "henon_heiles", "kepler", "relativistic_oscillator"])
@pytest.mark.parametrize("name", BENCHMARKED)
def test_every_method_keeps_the_structure_to_rounding_and_no_better(system, name):
    tableau = integrators[name]
    found = structure(systems[system], tableau, t_end=systems[system].t_end)
    # A matrix of determinant 1 has a norm of 1 or more; the tangent map is the flow's but for the method's error.
    assert found.growth > 0.999
    updates = found.steps * systems[system].dimension * (2 * tableau.stages + 1)
    for prefix in ("", "plain_"):
        error, walk, bound = (getattr(found, f"{prefix}return_{key}") for key in ("error", "walk", "bound"))
        # Three standard deviations of a random walk; each of its ends is below a thousandth of one in 0.08 % of cases,
        # and the error is the largest of two ends or more.
        assert walk / 1000 < error < 3 * walk
        # Cauchy and Schwarz, over the run and the run back.
        assert walk < bound <= np.sqrt(2 * updates) * walk * (1 + 1e-12)
    # The walk is carried on by the rms norm, which only one entry of the worst state has, so that defects are about a
    # twentieth of it; of one degree of freedom it is a single number, det J - 1, which 0.01 % of cases bring this near.
    assert found.symplectic_walk / 100_000 < found.symplectic_defect < 3 * found.symplectic_walk < 1e-18
    # Ruth's mean energy error at this step size is below 1e-4 everywhere, and so is what its trend comes to.
    assert 0 < abs(found.energy_drift) < 1e-4
    # Twenty times: the blocks of a chaotic orbit are not independent, and among a dozen neighbours of its start trends
    # reach ten half widths; and rounding limits what a trend can be.
    assert abs(found.energy_drift) < 20 * found.energy_drift_interval
    assert 0 < found.energy_walk < found.energy_drift_interval


def swirling():
    """A force with a curl, so of no potential: it feeds the energy and shears areas."""
    sound = systems["henon_heiles"]
    return replace(
        sound, name="swirling", V=lambda q: (q[0] * q[0] + q[1] * q[1]) / 2,
        grad_V=lambda q: (q[0] + q[1] / 1000, q[1] - q[0] / 1000), t_end="50", q0=("1", "0"), p0=("0", "1"),
    )  # fmt: skip


@pytest.mark.slow
def test_a_force_without_a_potential_is_found_out(monkeypatch):
    monkeypatch.setattr(kernels, "check_gradients", lambda system: None)  # it would refuse the system at once
    tableau = integrators["babs7o7h"]
    found = structure(swirling(), tableau, t_end="50")
    assert found.symplectic_defect > 1e-4
    # The circle x + iy = exp(it) gains dH/dt = -curl/1000 (x v - y u): 1e-3 for each unit of time, H0 = 1.
    found = structure(swirling(), tableau, t_end="0.1")  # the trend is over ten times that
    assert abs(abs(found.energy_drift) - 1e-3) < 1e-5 + found.energy_drift_interval


def test_method_that_needs_quadratic_kinetic_energy_is_left_out():
    with pytest.raises(NearharmonicError, match=r"srkn_a17.*relativistic_oscillator does not have"):
        nh.integrate("relativistic_oscillator", "srkn_a17", 0.1)
    assert measure(["srkn_a17", "ruth"])["run"].variables["integrator"][1].tolist() == ["ruth"]


@pytest.fixture(scope="module")
def cube():
    contents = measure(("ruth", "babs7o7h", "babps9o7h"))["run"]
    return reductions.kinetic_energy_cube(assembled(contents.variables, contents.coordinates, {}))


@pytest.mark.parametrize("amplitude", [0.01, 1.0])
def test_runs_of_amplitude_are_those_of_system_begun_there(cube, amplitude):
    system = replace(systems["relativistic_oscillator"], q0=(f"{amplitude}",))
    taus = cube.tau_per_stage.values[::10]
    expected = nh.sweep(system, "babs7o7h", taus * 7)
    found = cube.sel(roles="own", amplitude=amplitude, integrator="babs7o7h", tau_per_stage=taus)
    np.testing.assert_array_equal(found.max_energy_error, expected.max_energy_error)
    # The same steps, summed in other blocks.
    np.testing.assert_allclose(found.mean_energy_error, expected.mean_energy_error, rtol=1e-12)


def test_exchanged_roles_are_method_on_conjugate_system_with_quadratic_T(cube):
    conjugate = nh.systems["sho"].__class__(
        name="conjugate",
        label="conjugate",
        V=lambda q: q[0] * q[0] / (1 + any_sqrt(1 + q[0] * q[0])),
        grad_V=lambda q: (q[0] / any_sqrt(1 + q[0] * q[0]),),
        q0=("0",),
        p0=("0.3",),
        t_end="500",
        units=systems["sho"].units,
        source="q -> p, p -> -q",
    )
    assert conjugate.quadratic_kinetic_energy
    taus = cube.tau_per_stage.values[8:21]
    expected = nh.sweep(conjugate, "babps9o7h", taus * 9)
    found = cube.sel(roles="exchanged", amplitude=0.3, integrator="babps9o7h", tau_per_stage=taus)
    # Not the same operations: energies differ by rounding, errors by 1e-16 over their size, 1e-10 at least.
    np.testing.assert_allclose(found.max_energy_error, expected.max_energy_error, rtol=1e-5)
