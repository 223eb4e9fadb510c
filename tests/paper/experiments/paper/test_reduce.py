"""Run files, their reductions, and the cubes of them."""

import json
import math

import mpmath
import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.engine.settings import Sweep
from nearharmonic.integrators import integrators
from nearharmonic.output.store import assembled, described, write
from nearharmonic.plotting.style import draw_profile
from nearharmonic.systems import systems
from nearharmonic.systems.user_file import SystemDefinition
from nearharmonic_paper.experiments.paper import reductions
from nearharmonic_paper.experiments.paper import reductions as reduce
from nearharmonic_paper.experiments.paper.reductions import numbers
from nearharmonic_paper.experiments.paper.run import integrate, integrate_run, runs_of, shards_of
from nearharmonic_paper.experiments.paper.tableaus import decompose
from nearharmonic_paper.tasks.reduction import Reductions, exact_sum
from support.oracles.reference_solutions import oscillator_step

# --- The numbers of a cube: each reduction against a closed form or a cube made by hand, whatever the shards.


def runs_of_dataset(variables, system):
    """A run file as the reductions are given it."""
    return assembled(variables, ["t"], {"system": system, "integrator": "ruth"})


def reduced(runs):
    """The numbers of Kepler runs by Ruth's method, of three stages."""
    return numbers(runs.assign_attrs(system="kepler", integrator="ruth"))


def cube_of(system, parts):
    """The cube of ``parts[integrator][precision]``, the numbers of each shard, made through no file."""
    methods = {}
    for name, by_precision in parts.items():
        layers = {p: xr.concat(shards, "tau_per_stage").sortby("tau_per_stage") for p, shards in by_precision.items()}
        methods[name] = reduce.joined([one.expand_dims(precision=[p]) for p, one in layers.items()], "precision")
    return reduce.cube_of(system, methods)


def sweep(system, **changes):
    wanted = {
        "t_end": "5", "lowest": 0.03, "highest": 1.0, "points_per_decade": 4, "precision": ("double",),
        "summation": "compensated", "samples": 20, "shards": 1,
    }  # fmt: skip
    return Sweep(system=system, **(wanted | changes))


def runs_in_memory(asked, methods):
    """``runs[integrator][precision]``, a dataset for each shard, as they come from the integration."""
    runs = {name: {} for name in methods}
    for name in methods:
        for index in range(shards_of(asked, name)):
            for run in runs_of(asked, name, index):
                made = runs_of_dataset(integrate_run(run), asked.system)
                runs[name].setdefault(run.precision, []).append(numbers(made))
    return runs


def cube_from_files(asked, methods, folder):
    """Cube by way of files, as the rules pass them on."""
    runs = {name: [] for name in methods}
    for name in methods:
        for index in range(shards_of(asked, name)):
            made = integrate(asked, name, index)["run"]
            runs[name].append(folder / f"{asked.shards}/{name}/{index}.h5")
            write(runs[name][-1], made.variables, made.attributes, made.groups, coordinates=made.coordinates)
    return reduce.reduce(asked, methods, **runs)["cube"]


def assert_same_bits(one, other):
    """Equal names, dimensions, types, values and attributes; NaN is equal to NaN, and nothing is close to anything."""
    assert set(one.variables) == set(other.variables)
    for name, variable in one.variables.items():
        assert (variable.dims, variable.dtype) == (other[name].dims, other[name].dtype), name
        exact = {"equal_nan": True} if variable.dtype.kind == "f" else {}
        assert np.array_equal(variable.values, other[name].values, **exact), name
        assert variable.attrs == other[name].attrs, name
    assert one.attrs == other.attrs


@pytest.mark.slow
def test_shards_read_from_files_make_one_cube_with_its_perihelion(tmp_path):
    """About a tenth to three times as many steps as samples, 8 to 380, the coarsest ending early."""
    asked = {"t_end": "8766", "lowest": 7.6, "highest": 380.0, "points_per_decade": 5, "samples": 100}
    cubes = [cube_from_files(sweep("kepler", shards=count, **asked), ("aba864",), tmp_path) for count in (1, 3, 5)]
    assert {"ok", "diverged"} == set(cubes[0].status.values.ravel())
    for parted in cubes[1:]:
        assert_same_bits(cubes[0], parted)


def test_the_coordinate_tau_is_the_step_as_used():
    """[0, 5] takes 4, 2 and 1 steps of three times 0.4, 0.8 and 1.6."""
    (run,) = runs_of(sweep("sho", lowest=0.4, highest=1.6, points_per_decade=1 / math.log10(2)), "ruth", 0)
    found = numbers(runs_of_dataset(integrate_run(run), "sho"))
    made = cube_of("sho", {"ruth": {"double": [found]}}).sel(precision="double")
    assert made.tau_per_stage.values.tolist() == [0.4, 0.8, 1.6]
    assert made.tau.values.tolist() == [[1.25, 2.5, 5.0]]
    assert made.steps.values.tolist() == [[4, 2, 1]]
    assert made.evaluations.values.tolist() == [[12, 6, 3]]


#: Mercury's period in hours, from NASA's aphelion (km), minimum velocity (km/s) and GM (km^3/s^2).
PERIOD = 2 * math.pi * math.sqrt((1 / (2 / 69.82e6 - 38.86**2 / 1.32712e11)) ** 3 / 1.32712e11) / 3600


def turning(rate, *, samples=60, t_end=8000.0):
    """Run file of two runs whose Laplace-Runge-Lenz vector rotates by ``rate`` rad/h; the second run diverged."""
    t = np.linspace(0, t_end, samples)
    angle = np.angle(np.exp(1j * (math.pi + rate * t)))
    over, each = ("tau_per_stage", "sample"), ("tau_per_stage",)
    return xr.Dataset(
        {
            "t": (over, np.tile(t, (2, 1))),
            "perihelion_angle": (over, np.tile(angle, (2, 1))),
            **{
                f"block_{name}_energy_error": (over, np.ones((2, samples)), described("since the previous sample"))
                for name in ("max", "mean")
            },
            "block_steps": (over, np.ones((2, samples), dtype=int)),
            "tau": (each, [24.5, 50.0]),
            "steps": (each, [samples, 3 * samples]),
            "evaluations": (each, [3 * samples, 7]),
            "status": (each, ["ok", "diverged"]),
            "diverged_at": (each, [0, 2]),
        },
        coords={"tau_per_stage": [8.0, 17.0]},
    )


@pytest.mark.parametrize("rate", [2e-4, -2e-4, 0.01])
def test_rotating_perihelion_advances_by_angle_of_one_period(rate):
    """Counterclockwise is positive, as the orbit; 0.01 rad/h is a turn of 1.4 rad from sample to sample."""
    made = reduced(turning(rate))
    assert made.perihelion_advance.values == pytest.approx([rate * PERIOD, np.nan], rel=1e-10, nan_ok=True)
    assert abs(made.perihelion_advance_interval[0]) < 1e-10
    assert np.isnan(made.perihelion_advance_interval[1])
    assert {made[f"perihelion_advance{end}"].attrs["units"] for end in ("", "_interval")} == {"rad"}


def test_interval_of_advance_is_that_of_slope_times_period():
    """A perihelion that swings by +-a about rest has residuals n a^2, over n - 2, and times squared n (n^2 - 1)/12."""
    run, a = turning(0.0, samples=40, t_end=39.0).isel(tau_per_stage=[0]), 0.01
    run["perihelion_angle"] = run.perihelion_angle * 0 + a * xr.DataArray([1, -1, -1, 1] * 10, dims="sample")
    deviation = math.sqrt(40 * a**2 / 38 / (40 * (40**2 - 1) / 12))
    made = reduced(run)
    assert abs(made.perihelion_advance.item()) < 1e-14
    # 2.024394 is Student's t_0.975 for 38 degrees of freedom, from tables.
    assert made.perihelion_advance_interval.item() == pytest.approx(2.024394 * deviation * PERIOD, rel=1e-6)


def test_a_cube_says_how_linear_the_perihelion_advance_is():
    """The rate is a in the first half and 2 a in the second; the oracle fits the known angles."""
    run, a = turning(0.0, samples=41, t_end=40.0), 0.01
    angle = a * np.concatenate([np.arange(20), 20 + 2 * np.arange(21)])
    run["perihelion_angle"] = run.perihelion_angle * 0 + xr.DataArray(angle, dims="sample")
    made = reduced(run)
    expected = [np.corrcoef(np.arange(41), angle)[0, 1] ** 2, np.nan]
    assert made.perihelion_advance_linearity.values == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert made.perihelion_advance_halves.values == pytest.approx([2, np.nan], rel=1e-12, nan_ok=True)
    assert {made[f"perihelion_advance_{end}"].attrs["units"] for end in ("linearity", "halves")} == {"1"}


def test_evaluations_per_orbit_are_those_of_the_step_as_used():
    made = reduced(turning(0.0))
    np.testing.assert_allclose(made.evaluations_per_orbit, [3 * PERIOD / 24.5, 3 * PERIOD / 50.0], rtol=1e-13)


def part(tau_per_stage, errors, *, steps=7):
    """Reduced numbers of one shard, made by hand: 10 times the step size is the step as used."""
    each, count = ("tau_per_stage",), len(tau_per_stage)
    whole = dict.fromkeys(("steps", "evaluations", "diverged_at"), (each, np.full(count, steps), {"units": "1"}))
    return xr.Dataset(
        {
            "tau": (each, 10 * np.array(tau_per_stage), {"units": "1"}),
            "max_energy_error": (each, np.array(errors), {"units": "1"}),
            "status": (each, ["ok"] * count, {"units": "1", "long_name": "ok or not"}),
            **whole,
        },
        coords={"tau_per_stage": list(tau_per_stage)},
        attrs={"settings": "of one shard"},
    )


GRID = [0.001, 0.01, 0.02, 0.04]


@pytest.fixture
def layered():
    """Slopes 2 and 1 in double; in extended 4, for the finest two step sizes of one method, not the first by name."""
    double = {"ruth": [1e-15, 1e-8, 4e-8, 16e-8], "aba864": [1e-15, 1e-8, 2e-8, 4e-8]}
    parts = {name: {"double": [part(GRID[1::2], e[1::2]), part(GRID[::2], e[::2])]} for name, e in double.items()}
    parts["ruth"]["extended"] = [part(GRID[:2], [1e-20, 1e-16], steps=9)]
    return cube_of("sho", parts)


def test_what_the_plan_left_out_is_filled_in_as_skipped(layered):
    assert layered.max_energy_error.dims == ("precision", "integrator", "tau_per_stage")
    assert layered.precision.values.tolist() == ["double", "extended"]
    made, missing = (layered.sel(precision="extended", integrator=name) for name in ("ruth", "aba864"))
    assert made.status.values.tolist() == ["ok", "ok", "skipped", "skipped"]
    assert missing.status.values.tolist() == ["skipped"] * 4
    for name in ("steps", "evaluations", "diverged_at"):
        assert layered[name].dtype.kind == "i"
        assert made[name].values.tolist() == [9, 9, 0, 0]
        assert missing[name].values.tolist() == [0] * 4
    for name in ("tau", "max_energy_error"):
        assert np.isnan(made[name]).values.tolist() == [False, False, True, True]
        assert np.isnan(missing[name]).all()


def test_methods_keep_their_order_and_step_sizes_ascend(layered):
    assert layered.integrator.values.tolist() == ["ruth", "aba864"]
    assert layered.label.values.tolist() == [integrators[name].label for name in ("ruth", "aba864")]
    assert layered.tau_per_stage.values.tolist() == GRID
    errors = layered.max_energy_error.sel(precision="double", integrator="ruth")
    assert errors.values.tolist() == [1e-15, 1e-8, 4e-8, 16e-8]


def test_observed_orders_are_those_of_double_precision(layered):
    assert layered.observed_order.dims == ("precision", "integrator")
    np.testing.assert_allclose(layered.observed_order.sel(precision="double"), [2, 1], atol=1e-9)


def test_cube_describes_its_system_and_no_single_shard(layered):
    start = {"q0": '["1"]', "p0": '["0"]', "parameters": "{}"}
    assert layered.attrs == {"system": "sho", "system_label": "simple harmonic oscillator", **start}
    assert layered.stages.values.tolist() == [3, 7]
    assert layered.status.attrs["long_name"] == "ok or not"
    assert {name: layered[name].attrs["units"] for name in layered.coords} == dict.fromkeys(layered.coords, "1")
    made = cube_of("kepler", {"ruth": {"double": [part(GRID, [1e-15] * 4)]}})
    assert made.attrs["system"] == "kepler"
    assert made.attrs["orbital_period"] == pytest.approx(PERIOD, rel=1e-13)
    assert made.tau_per_stage.attrs["units"] == "h"


@pytest.mark.parametrize("precision", ["double", pytest.param("extended", marks=pytest.mark.slow)])
def test_run_is_repeated_from_what_its_cube_holds(precision):
    changed = SystemDefinition(base="kepler", q0=("46.1", "0.3"), parameters=(("GM", "1.7"),))
    with systems.defining({"near_sun": changed}):
        asked = sweep("near_sun", t_end="3000", lowest=20, precision=(precision,), highest=60)
        cube = reduce.cube_of("near_sun", {"ruth": layers(asked)})
    start = {name: json.loads(cube.attrs[name]) for name in ("q0", "p0", "parameters")}
    assert start["q0"] == ["46.1", "0.3"]
    assert start["parameters"] == {"GM": "1.7"}
    for one in (cube.isel(precision=0, integrator=0, tau_per_stage=place) for place in (0, -1)):
        tau = one.tau_per_stage.item() * one.stages.item()
        assert one.tau.item() == pytest.approx(tau, rel=0.1)  # tau divides the interval
        again = nh.integrate("kepler", "ruth", one.tau.item(), t_end="3000", precision=precision, **start)
        assert again.max_energy_error.item() == one.max_energy_error.item() > 0


def layers(asked):
    """The numbers of Ruth's method over (precision, tau_per_stage)."""
    made = runs_in_memory(asked, ["ruth"])["ruth"]
    return reduce.joined([numbers(one).expand_dims(precision=[p]) for p, (one,) in made.items()], "precision")


def taylor_errors(tableau, highest):
    """|x^(l)(0) - l! c_l| for l = 1 ... highest, c_l mpmath's Taylor coefficients of the position after one step."""

    def position(tau):
        step = oscillator_step(tableau, tau)
        return step[0, 0] - step[0, 1]

    with mpmath.workdps(200):
        made, exact = (mpmath.taylor(f, 0, highest) for f in (position, lambda t: mpmath.cos(t) - mpmath.sin(t)))
        return [float(abs(a - b) * mpmath.factorial(n)) for n, (a, b) in enumerate(zip(made, exact, strict=True))][1:]


def test_terms_stand_at_their_method_composition_and_order():
    terms = decompose(["ruth", "babs7o7h"])["cube"]
    assert terms.kappa.shape == (2, 2, 15)
    for name, reach in (("ruth", {"drift": 7, "kick": 6}), ("babs7o7h", {"drift": 15, "kick": 14})):
        for first, highest in reach.items():
            found = terms.kappa.sel(integrator=name, first=first).values
            expected = taylor_errors(integrators[name].role(first), highest)
            # mpmath's differences keep more than half of 200 digits, and printed digits leave 1e-60 of a zero.
            np.testing.assert_allclose(found[:highest], expected, rtol=1e-14, atol=1e-50)
            assert np.isnan(found[highest:]).all()
    assert terms.label.values.tolist() == [integrators[name].label for name in ("ruth", "babs7o7h")]
    assert all({"units", "long_name"} <= set(v.attrs) for v in terms.variables.values())


def test_cubes_and_figures_of_own_systems_have_their_energy():
    own = {"venus": SystemDefinition(base="sho", label="not in the paper", q0=("1.5",), p0=("2",))}
    with systems.defining(own):
        for name, says, energy in (("sho", "name in the paper", (None, None)), ("venus", "label", (3.125, "1"))):
            cube = cube_of(name, runs_in_memory(sweep(name), ["ruth"]))
            assert cube.label.attrs["long_name"] == says
            assert (cube.attrs.get("energy_at_start"), cube.attrs.get("energy_unit")) == energy
            assert (
                draw_profile(cube)
                .axes[0]
                .get_title(loc="right")
                .endswith("oscillator" if name == "sho" else ", $H_0$ = 3.125")
            )


# --- Maxima and means over every step, from blocks of steps that were made by hand.


def mean_energy_error(blocks):
    return reductions.mean_energy_error(blocks)[1]


def max_energy_error(blocks):
    return reductions.max_energy_error(blocks)[1]


def blocks(**changes):
    """Four runs: four steps in blocks of 3 and 1; nine in blocks of 1, 3 and 5; one that is shorter; one that left."""
    nan = np.nan
    values = {
        "block_steps": [[0, 3, 1, 0], [0, 1, 3, 5], [0, 2, 0, 0], [0, 3, 3, 3]],
        "block_mean_energy_error": [[0, 2, 8, nan], [0, 1, 2, 4], [0, 0.5, nan, nan], [0, 1, nan, nan]],
        "block_max_energy_error": [[0, 4, 8, nan], [0, 1, 16, 4], [0, 0.75, nan, nan], [0, 1, nan, nan]],
    }
    notes = described("of |H - H0|/|H0| since the previous sample")
    runs = {name: (("tau_per_stage", "sample"), np.array(rows), notes) for name, rows in (values | changes).items()}
    status = ["ok", "ok", "ok", "diverged"]
    return xr.Dataset(runs | {"steps": ("tau_per_stage", [4, 9, 2, 9]), "status": ("tau_per_stage", status)})


def test_a_mean_over_every_step_weights_blocks_by_their_length():
    """(3 x 2 + 1 x 8) / 4; (1 + 3 x 2 + 5 x 4) / 9; half: sums of powers of two, exact."""
    assert mean_energy_error(blocks()).tolist() == [3.5, 3.0, 0.5, np.inf]


def test_maximum_over_every_step_is_largest_of_blocks():
    assert max_energy_error(blocks()).tolist() == [8.0, 16.0, 0.75, np.inf]


def test_a_mean_is_the_same_bits_in_longer_company():
    random = np.random.default_rng(1)
    for length in (3, 9, 100, 200):
        mean = random.uniform(0, 1, (1, length))
        steps = random.integers(1, 7, (1, length))
        alone = xr.Dataset({
            "block_mean_energy_error": (("tau_per_stage", "sample"), mean, described("mean since the previous sample")),
            "block_steps": (("tau_per_stage", "sample"), steps),
            "steps": ("tau_per_stage", steps.sum(axis=1)),
            "status": ("tau_per_stage", ["ok"]),
        })  # fmt: skip
        padded = alone.pad(sample=(0, 300), constant_values={"block_mean_energy_error": np.nan, "block_steps": 0})
        assert mean_energy_error(alone).item() == mean_energy_error(padded).item()


def test_a_reduction_is_declared_by_the_variables_that_it_needs():
    reduction = Reductions()

    @reduction("q", "status")
    def farthest(runs):
        return abs(runs.q).max("sample").assign_attrs(units="1", long_name="largest |q|")

    @reduction("farthest", over="tau_per_stage")
    def widest(curves):
        return xr.Dataset({"widest_run": curves.farthest.max("tau_per_stage")})

    runs = blocks().assign(q=(("tau_per_stage", "sample"), [[1, -3, 2, 0]] * 4))
    assert reduction.of(blocks()).sizes == {}
    found = reduction.of(runs)
    assert found.farthest.values.tolist() == [3] * 4
    assert found.farthest.attrs["long_name"] == "largest |q|"
    assert set(found.data_vars) == {"farthest"}
    assert reduction.of(found, over="tau_per_stage").widest_run.item() == 3


def test_an_exact_sum_depends_on_no_order_and_skips_nan():
    """1e16 + 1 + ... in any order: partial sums round the ones away, the exact sum is 1e16 + 1000."""
    row = np.concatenate([[1e16], np.ones(1000), [np.nan] * 5])
    orders = [row, row[::-1], np.random.default_rng(1).permutation(row)]
    table = xr.DataArray([*orders, np.full(row.size, np.nan)], dims=("run", "sample"))
    assert exact_sum(table, "sample").values[:3].tolist() == [1e16 + 1000] * 3
    assert np.isnan(exact_sum(table, "sample").values[3])
