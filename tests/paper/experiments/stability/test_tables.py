"""Cubes and tables of the stress tests: cells against closed forms, and rows from cubes made by hand."""

from itertools import pairwise
from math import acosh, inf

import numpy as np
import pytest
import xarray as xr
from scipy.stats import linregress
from scipy.stats import t as student

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import read
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability import reductions
from nearharmonic_paper.experiments.stability import settings as sizes
from nearharmonic_paper.experiments.stability.reductions import OF_KINETIC_ENERGY as reduction
from nearharmonic_paper.experiments.stability.run import exchanged
from nearharmonic_paper.tasks.job import covered, write
from nearharmonic_paper.tasks.provenance import function_of, provenance, task
from support.oracles.structures import runs_of, structure

# --- The cube and the table of linear stability: cells against closed forms and products of matrices.


LEAPFROG = integrators["leapfrog"]
#: Two leapfrogs of half the step: with cos(phase) = 1 - tau^2/8, half the trace is cos(2 phase).
TWO = Tableau(
    name="two", label="Two leapfrogs", order=2, first="kick", kick=("0.25", "0.5", "0.25"), drift=("0.5", "0.5"),
    source="the leapfrog, twice", digits=80,
)  # fmt: skip


def half_trace(tableau, tau):
    """Half the trace of the product of shears, in doubles."""
    K = np.eye(2)
    for i, c in enumerate([c for pair in zip(tableau.outer, (*tableau.inner, "0"), strict=True) for c in pair][:-1]):
        shear = float(c) * tau
        drifts = (tableau.first == "drift") == (i % 2 == 0)
        K = np.array([[1, shear], [0, 1]] if drifts else [[1, 0], [-shear, 1]]) @ K
    return K.trace() / 2


def cells(tableau):
    table = reductions.linear_stability_table([tableau])
    return table.records()


def test_the_leapfrog_is_stable_up_to_two():
    (row,) = cells(LEAPFROG)
    growth = [row.pop(key) for key in ("largest growth per step", "at step size", "largest growth per time")]
    assert row == {
        "integrator": "leapfrog", "stages": 1, "stable from": "0", "stable to": "2.000000000000",
        "stable to, per stage": "2.000000000000", "known limit": "", "unstable to": "inf", "trace touches 2 at": "",
    }  # fmt: skip
    assert growth[:2] == [inf, inf]
    # arcosh(tau^2/2 - 1)/tau, scanned: near its maximum it is flat, so that a grid of 1e-4 is good to 1e-8.
    assert growth[2] == pytest.approx(max(acosh(t * t / 2 - 1) / t for t in np.arange(2, 8, 1e-4)), rel=1e-7)


def test_limits_are_divided_by_stages_and_touching_points_named():
    """Two leapfrogs: twice the limit, the same per stage; the trace touches -2 at phase pi/2, at tau = 2 sqrt(2)."""
    (row,) = cells(TWO)
    assert (row["stages"], row["stable to"], row["stable to, per stage"]) == (2, "4.000000000000", "2.000000000000")
    assert row["trace touches 2 at"] == "2.828427124746"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aba864", pytest.param("babps9o7h", marks=pytest.mark.slow)])
def test_each_interval_of_stability_ends_at_gap_with_its_growth(name):
    tableau, rows = integrators[name], cells(integrators[name])
    assert len(rows) > 1
    assert (rows[0]["stable from"], rows[-1]["unstable to"]) == ("0", "inf")
    for row, following in pairwise(rows):
        start, end = float(row["stable to"]), float(row["unstable to"])
        assert float(row["stable from"]) < start < end == float(following["stable from"])
        assert float(row["stable to, per stage"]) == pytest.approx(start / tableau.stages, rel=1e-11)
        scan = np.linspace(start, end, 2001)[1:-1]
        growth = np.arccosh(np.maximum(1, [abs(half_trace(tableau, tau)) for tau in scan]))
        # A parabola about its top: the grid misses it by (1/2000)^2, and traces near 2 keep half of 1e-16's digits.
        assert row["largest growth per step"] == pytest.approx(growth.max(), rel=1e-5)
        assert row["largest growth per time"] == pytest.approx((growth / scan).max(), rel=1e-5)
        assert row["at step size"] == pytest.approx(scan[growth.argmax()], abs=2e-3 * (end - start))
    assert sum(row["known limit"] != "" for row in rows) == 1
    assert rows[0]["stable to"].startswith(rows[0]["known limit"][:9])


def test_cube_has_half_trace_over_step_size_per_stage():
    tableaus = [LEAPFROG, TWO, integrators["babps9o7h"]]
    cube = reductions.linear_stability_cube(tableaus)
    tau = cube.tau_per_stage.values
    assert (tau[0], tau[-1], len(tau)) == (0, 2.4, 961)
    np.testing.assert_allclose(cube.half_trace.sel(integrator="leapfrog"), 1 - tau**2 / 2, atol=1e-14)
    np.testing.assert_allclose(cube.half_trace.sel(integrator="two"), 2 * (1 - tau**2 / 2) ** 2 - 1, atol=1e-13)
    # The polynomial's terms reach 1e3 before they cancel.
    expected = [half_trace(tableaus[2], 9 * t) for t in tau]
    np.testing.assert_allclose(cube.half_trace.sel(integrator="babps9o7h"), expected, atol=1e-9, rtol=1e-9)
    assert cube.stages.values.tolist() == [1, 2, 9]


def test_cube_has_gaps_of_table_and_nothing_past_last():
    tableaus = [LEAPFROG, integrators["babps9o7h"]]
    cube = reductions.linear_stability_cube(tableaus)
    for tableau in tableaus:
        one, rows = cube.sel(integrator=tableau.name), cells(tableau)
        for variable, column in (
            ("start", "stable to"), ("end", "unstable to"), ("growth_per_step", "largest growth per step"),
            ("growth_per_time", "largest growth per time"),
        ):  # fmt: skip
            values = one[variable].values
            assert values[: len(rows)] == pytest.approx([float(row[column]) for row in rows], rel=1e-11)
            assert np.isnan(values[len(rows) :]).all()
    assert np.isnan(cube.start.values).any()


# --- The cube and the table of structure: every number at its place, and on the oscillator against its closed form.


NYSTROM = next(tableau.name for tableau in integrators.values() if tableau.requires)
METHODS = ["ruth", NYSTROM, "leapfrog"]
T_END = {"sho": "20", "relativistic_oscillator": "50"}
#: Variables of the cube, and columns of the table, in their order.
KEYS = [
    "tau_per_stage", "steps", "growth", "return_error", "return_walk", "return_bound", "plain_return_error",
    "plain_return_walk", "plain_return_bound", "symplectic_defect", "symplectic_walk", "energy_drift",
    "energy_drift_interval", "energy_walk",
]  # fmt: skip
#: Every pair of system and method that fit each other.
FITTING = [("sho", name) for name in METHODS] + [("relativistic_oscillator", name) for name in ("ruth", "leapfrog")]


@pytest.mark.slow
def test_a_number_stands_at_its_system_and_method():
    tableaus = [integrators[name] for name in METHODS]
    runs = {name: runs_of(systems[name], tableaus, t_end) for name, t_end in T_END.items()}
    cube = reductions.structure_cube(tableaus, runs)
    assert [*cube] == KEYS
    for system, name in FITTING:
        alone = vars(structure(systems[system], integrators[name], t_end=T_END[system]))
        assert {key: cube[key].sel(system=system, integrator=name).item() for key in cube} == alone
    assert np.isnan(cube.sel(system="relativistic_oscillator", integrator=NYSTROM).to_dataarray()).all()
    assert cube.label.sel(integrator="leapfrog") == "Leapfrog"


def test_row_has_all_numbers_and_unfit_methods_have_none():
    steps = np.arange(320.0, 326).reshape(2, 3)
    steps[1, 1] = np.nan
    dims = ("system", "integrator")
    coordinates = {"system": [*T_END], "integrator": METHODS}
    cube = xr.Dataset({"return_error": (dims, steps / 7), "steps": (dims, steps)}, coordinates)
    table = reductions.structure_table(cube)
    assert table.header == ("system", "integrator", "return error", "steps")
    assert [row[:2] for row in table.rows] == FITTING
    assert [row[2:] for row in table.rows] == [(n / 7, n) for n in (320, 321, 322, 323, 325)]
    assert type(table.rows[0][3]) is int


@pytest.fixture(scope="module")
def oscillator():
    return structure(systems["sho"], integrators["ruth"], t_end="500")


#: 10^4/25 evaluations in steps of three, over a 25th of [0, 500]; u = 2^-53.
STEPS, END, U = 133, 20.0, 2.0**-53


def test_steps_cover_25th_of_interval_at_ten_thousand_evaluations(oscillator):
    assert oscillator.steps == STEPS
    assert oscillator.tau_per_stage == pytest.approx(END / STEPS / 3, rel=1e-15)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def near(value, rel):
    """Without pytest's absolute tolerance of 1e-12, which hides all of these numbers."""
    return pytest.approx(value, rel=rel, abs=0)


def test_rounding_is_the_sum_of_all_updates_of_the_circle(oscillator):
    """q = cos t, p = -sin t at 65 states; a rotation carries errors on as they are. Ruth errs by 1e-5 at this step."""
    t = np.arange(65) * STEPS // 64 * END / STEPS
    q, p = rms(np.cos(t)), rms(np.sin(t))
    assert oscillator.growth == near(1, rel=1e-4)
    # Plain: four drifts round q, three kicks p; forwards and back.
    squares, total = STEPS * (4 * q**2 + 3 * p**2), STEPS * (4 * q + 3 * p)
    assert oscillator.plain_return_walk == near(U * np.sqrt(2 * squares), rel=1e-3)
    assert oscillator.plain_return_bound == near(U * 2 * total, rel=1e-3)
    # Symplectic: double-double rounds by 2^-104, divided by a spacing of 2^-24; J enters twice.
    assert oscillator.symplectic_walk == near(2 * 2.0**-104 * 2.0**24 * np.sqrt(squares), rel=1e-3)
    # Compensated: an update c tau is rounded of the increment, c tau p for q and c tau q for p.
    w, tau = 1 / (2 - 2 ** (1 / 3)), END / STEPS
    drifts, kicks = np.array([w / 2, (w - 1) / 2] * 2) * tau * p, np.array([w, 2 * w - 1, w]) * tau * q
    squares, total = STEPS * (sum(drifts**2) + sum(kicks**2)), STEPS * (sum(drifts) + sum(kicks))
    assert oscillator.return_walk == near(U * np.sqrt(2 * squares), rel=1e-3)
    assert oscillator.return_bound == near(U * 2 * total, rel=1e-3)
    # Energy: each update is rounded by u c tau |q p| of H0 = 1/2.
    coefficients = sum(c**2 for c in (w / 2, (w - 1) / 2) * 2) + sum(c**2 for c in (w, 2 * w - 1, w))
    steps = STEPS * 250
    power = np.sqrt(1 / 8) / 0.5  # of cos t sin t, over hundreds of periods
    assert oscillator.energy_walk == near(U * tau * power * np.sqrt(coefficients * steps), rel=1e-2)


def test_drift_of_energy_is_regression_through_means_of_fifty_blocks(oscillator):
    steps = STEPS * 250
    run = nh.integrate("sho", "ruth", 5000 / steps, t_end=5000, samples=steps + 1)
    assert run.steps == steps
    means = [block.mean() for block in np.array_split(run.energy_error.values[1:], 50)]
    fit = linregress(np.linspace(0.01, 0.99, 50), means)
    assert oscillator.energy_drift == near(fit.slope, rel=1e-6)
    assert oscillator.energy_drift_interval == near(fit.stderr * student.ppf(0.975, 48), rel=1e-6)


# --- Ratios of the table of kinetic energies, from a cube made by hand.


AMPLITUDES, GRID = [0.01, 0.3, 1.0], [0.01, 0.049, 0.06, 1.0]


@pytest.fixture
def cube():
    """At 0.049, the step size nearest to 0.05: Ruth errs by 8, 16, 32 in its own roles, twice that exchanged; the other
    by 2, 16, 128 and 4, 64, 8; elsewhere all err by 7."""
    errors = np.full((2, 3, 2, 4), 7.0)
    errors[0, :, 0, 1], errors[1, :, 0, 1] = [8, 16, 32], [16, 32, 64]
    errors[0, :, 1, 1], errors[1, :, 1, 1] = [2, 16, 128], [4, 64, 8]
    dims = ("roles", "amplitude", "integrator", "tau_per_stage")
    data = xr.Dataset(
        {"max_energy_error": (dims, errors)},
        coords={
            "roles": ["own", "exchanged"], "amplitude": AMPLITUDES, "integrator": ["ruth", "babs7o7h"],
            "tau_per_stage": GRID,
        },
    )  # fmt: skip
    return data.assign(reduction.of(data, over="tau_per_stage"))


def test_errors_are_relative_to_ruth_and_decline_to_least_amplitude(cube):
    table = reductions.kinetic_energy_table(cube)
    assert table.header == (
        "integrator", "roles", "error / Ruth's at A = 0.01", "error / Ruth's at A = 0.3", "error / Ruth's at A = 1",
        "decline to A = 1",
    )  # fmt: skip
    assert table.rows == [
        ("ruth", "own", 1.0, 1.0, 1.0, 1.0), ("ruth", "exchanged", 2.0, 2.0, 2.0, 1.0),
        ("babs7o7h", "own", 0.25, 1.0, 4.0, 16.0), ("babs7o7h", "exchanged", 0.5, 4.0, 0.25, 0.5),
    ]  # fmt: skip


def test_without_the_yardstick_there_are_no_ratios(cube):
    alone = cube.isel(integrator=[1])
    assert np.isnan(reduction.of(alone, over="tau_per_stage").relative_error).all()


@pytest.mark.parametrize(("name", "first"), [("ruth", "kick"), ("babs7o7h", "drift")])
def test_exchanged_roles_give_the_rows_to_the_other_operator(name, first):
    own, other = integrators[name], exchanged(integrators[name])
    assert (other.first, other.kick, other.drift) == (first, own.drift, own.kick)


# --- Rows of the tables of the ensembles, from cubes made by hand; what cubes add to the maps, from closed forms.


ONE = {"units": "1", "long_name": "made by hand"}
QUANTILES = (0.05, 0.5, 0.95, 1.0)


def cube_of(reduction, runs):
    return reduction(reductions.stacked(list(runs), runs.values()))


def henon_heiles(shares):
    """Escaped shares over (energy, tau_per_stage); the quantile q at step size number i errs by (i + 1) q."""
    errors = np.array([1.0, 2.0, 3.0, 4.0])[None, :, None] * np.array(QUANTILES) * np.ones((2, 1, 1))
    return xr.Dataset(
        {
            "escaped": (("energy", "tau_per_stage"), np.array(shares), ONE),
            "energy_error": (("energy", "tau_per_stage", "quantile"), errors, ONE),
        },
        coords={"tau_per_stage": [0.1, 0.2, 0.3, 0.4], "energy": [0.125, 1 / 6], "quantile": list(QUANTILES)},
    )


@pytest.fixture
def ensembles():
    runs = {
        "leapfrog": henon_heiles([[0, 0.01, 0.011, 0], [0.5, 0, 0, 0]]),
        "ruth": henon_heiles([[0, 0, 0, 0], [0, 0, 0.2, 0.1]]),
    }
    return cube_of(reductions.henon_heiles_cube, runs)


def test_row_has_largest_trusted_step_errors_and_share_of_limit(ensembles):
    """One percent is trusted; a loss ends it, though coarser steps lose none. Limits: 2, and 1.573401947 over 3."""
    rows = {(row["integrator"], row["energy"]): row for row in reductions.henon_heiles_table(ensembles).records()}
    assert rows["leapfrog", 0.125] == {
        "integrator": "leapfrog", "energy": 0.125, "linear_limit_tau_per_stage": 2.0,
        "tau_per_stage_escaped_up_to_0.01": 0.2, "median_energy_error_there": 1.0, "worst_energy_error_there": 2.0,
        "share_of_linear_limit": 0.1,
    }  # fmt: skip
    ruth = rows["ruth", 0.125]
    assert ruth["linear_limit_tau_per_stage"] == pytest.approx(1.573401947 / 3, rel=1e-9)
    assert ruth["share_of_linear_limit"] == pytest.approx(0.4 * 3 / 1.573401947, rel=1e-9)
    assert (ruth["median_energy_error_there"], ruth["worst_energy_error_there"]) == (2.0, 4.0)
    assert rows["ruth", 1 / 6]["tau_per_stage_escaped_up_to_0.01"] == 0.2


def test_a_method_that_is_never_trusted_has_no_errors_there(ensembles):
    (row,) = [
        r
        for r in reductions.henon_heiles_table(ensembles).records()
        if (r["integrator"], r["energy"]) == ("leapfrog", 1 / 6)
    ]
    known = {"integrator", "energy", "linear_limit_tau_per_stage"}
    assert np.isnan([v for k, v in row.items() if k not in known]).all()


def test_kepler_evaluations_are_steps_times_stages_at_nearest_eccentricity():
    """Errors 1e-6 (100 (1 + e) / n)^2 of n steps a period: the contour lies at 100 (1 + e) steps."""
    grid = np.array([0.0, 0.21, 0.3, 0.52, 0.79, 0.9, 0.96, 0.99])
    steps = np.array([10, 1000])
    states = ("tau_per_stage", "eccentricity", "sample", "component"), np.zeros((2, 8, 3, 2)), ONE
    errors = ("tau_per_stage", "eccentricity"), 1e-6 * (100 * (1 + grid) / steps[:, None]) ** 2, ONE
    part = xr.Dataset(
        {"q": states, "p": states, "energy_error": errors, "steps_per_orbit": ("tau_per_stage", steps, ONE)},
        coords={"tau_per_stage": [0.1, 0.001], "eccentricity": grid, "component": [0, 1]},
    )
    cube = cube_of(reductions.kepler_cube, {"leapfrog": part, "babs7o7h": part})
    assert not {"q", "p", "sample", "component"} & set(cube.variables)
    assert cube.evaluations_per_orbit.sel(integrator="leapfrog").values.tolist() == [10, 1000]
    assert cube.evaluations_per_orbit.sel(integrator="babs7o7h").values.tolist() == [70, 7000]
    first, second = reductions.kepler_table(cube).records()
    shown = {"e_0.000": 100, "e_0.210": 121, "e_0.520": 152, "e_0.790": 179, "e_0.900": 190, "e_0.960": 196,
             "e_0.990": 199}  # fmt: skip
    assert first == {"integrator": "leapfrog"} | {k: pytest.approx(v) for k, v in shown.items()}
    assert second == {"integrator": "babs7o7h"} | {k: pytest.approx(7 * v) for k, v in shown.items()}


TIME = np.array([1.0, 4.0, 9.0, 16.0])


def rounding(scale):
    """Two orbits: energy errors (1, -3) t^(1/2), lags (2, 4) t^(3/2); in the other source energies grow as t."""
    energy, lag = np.array([[1.0], [-3.0]]), np.array([[2.0], [4.0]])
    return xr.Dataset(
        {
            "energy_error": (
                ("source", "orbit", "sample"), scale * np.array([energy * TIME**0.5, energy * TIME]), ONE,
            ),
            "lag": (
                ("source", "orbit", "sample"), scale * np.array([lag * TIME**1.5] * 2), ONE | {"units": "rad"},
            ),
            "time": ("sample", TIME, ONE),
        },
        coords={"source": ["plain", "coefficients"]},
    ).set_coords("time")  # fmt: skip


def test_rounding_rows_have_power_law_final_rms_and_bias():
    """At t = 16: rms of energies 4 sqrt((1 + 9)/2) and mean |-1| 4; of lags 64 sqrt((4 + 16)/2) and 3 x 64."""
    cube = cube_of(reductions.rounding_cube, {"leapfrog": rounding(1.0), "ruth": rounding(10.0)})
    rows = {(r["integrator"], r["source"], r["quantity"]): r for r in reductions.rounding_table(cube).records()}
    assert len(rows) == 8
    for name, scale in (("leapfrog", 1), ("ruth", 10)):
        energy, lag = rows[name, "plain", "energy_error"], rows[name, "plain", "lag"]
        assert energy["exponent"] == pytest.approx(0.5, rel=1e-12)
        assert energy["rms_at_end"] == pytest.approx(scale * 4 * 5**0.5, rel=1e-14)
        assert energy["bias_over_rms"] == pytest.approx(1 / 5**0.5, rel=1e-14)
        assert lag["exponent"] == pytest.approx(1.5, rel=1e-12)
        assert lag["rms_at_end"] == pytest.approx(scale * 64 * 10**0.5, rel=1e-14)
        assert lag["bias_over_rms"] == pytest.approx(3 / 10**0.5, rel=1e-14)
        assert (energy["brouwer"], lag["brouwer"]) == (0.5, 1.5)
        # Without one orbit the exponent is the same: both errors are pure powers.
        assert abs(energy["interval_95"]) < 1e-12
        assert rows[name, "coefficients", "energy_error"]["exponent"] == pytest.approx(1.0, rel=1e-12)
        assert rows[name, "coefficients", "energy_error"]["brouwer"] == ""
    np.testing.assert_allclose(cube.energy_error_rms.sel(integrator="ruth", source="plain"), 10 * 5**0.5 * TIME**0.5)
    assert (cube.lag_bias.attrs["units"], cube.lag_exponent.attrs["units"], cube.lag_rms.attrs["units"]) == (
        "rad", "1", "rad",
    )  # fmt: skip


def test_cube_of_one_method_has_times_of_each_method():
    assert cube_of(reductions.rounding_cube, {"leapfrog": rounding(1.0)}).time.dims == ("integrator", "sample")


def test_interval_of_exponent_is_jackknife_of_its_orbits():
    """Three orbits whose squares are 1 at t = 1 and 2, 2, 8 at t = 4: without one, their means there are 5, 5 and 2.

    The exponents a, a, b differ by ln(5/2)/(2 ln 4); their squares about the mean sum to 2/3 (a - b)^2, which the
    jackknife multiplies by (n - 1)/n = 2/3; t_0.975 is 4.302653 for two degrees of freedom.
    """
    errors = np.sqrt([[1.0, 2.0], [1.0, 2.0], [1.0, 8.0]])
    over = ("source", "orbit", "sample")
    part = xr.Dataset(
        {"energy_error": (over, [errors], ONE), "lag": (over, [errors], ONE), "time": ("sample", [1.0, 4.0], ONE)},
        coords={"source": ["plain"]},
    )
    first, _ = reductions.rounding_table(cube_of(reductions.rounding_cube, {"leapfrog": part})).records()
    assert first["exponent"] == pytest.approx(np.log(4) / (2 * np.log(4)), rel=1e-14)
    assert first["interval_95"] == pytest.approx(4.302652729749462 * 2 / 3 * np.log(2.5) / (2 * np.log(4)), rel=1e-13)


# --- The stress tests from their tasks to their cubes.


PAIR = ("ruth", "babps9o7h")
SMALL = {
    "henon_heiles": sizes.EnsembleSettings(
        trajectories=10,
        energies=("1/24", "1/6"),
        t_end="20",
        tau_per_stage=sizes.EvenStepSizes(lowest="0.1", highest="0.7", spacing="0.1"),
    ),
    "kepler": sizes.MapSettings(
        eccentricities=6,
        highest_eccentricity=0.9,
        orbits=3,
        evaluations_per_orbit=sizes.EvaluationsGrid(lowest=10.0, highest=1000.0, points_per_decade=4),
    ),
    "rounding": sizes.RoundingSettings(ensemble=3, steps=8000, evaluations_per_orbit=400, seed=1),
}
REDUCTIONS = {
    "henon_heiles": reductions.henon_heiles_cube,
    "kepler": reductions.kepler_cube,
    "rounding": reductions.rounding_cube,
}


def results(function, inputs=None, **settings):
    """Results and provenance of a job, with nothing in reach that its digests do not cover."""
    asked = task(f"nearharmonic_paper.experiments.stability.{function}", **settings)
    with covered(asked):
        return function_of(asked)(**settings, **(inputs or {})), provenance(asked)


@pytest.mark.parametrize("name", SMALL)
def test_cube_holds_runs_in_order_of_methods(tmp_path, name):
    paths = {}
    for method in reversed(PAIR):
        made, origin = results(f"run:{name}_measure", integrator=method, settings=SMALL[name])
        paths[method] = str(tmp_path / f"{method}.h5")
        write(made["run"], [paths[method]], origin)
    made, _ = results(f"reductions:{name}", paths, integrators=PAIR, settings=SMALL[name])
    cube = made["cube"]
    expected = REDUCTIONS[name](reductions.stacked(PAIR, [read(paths[method]) for method in PAIR]))
    xr.testing.assert_equal(cube, expected)
    assert cube.integrator.values.tolist() == list(PAIR)
    assert cube.attrs == {}
