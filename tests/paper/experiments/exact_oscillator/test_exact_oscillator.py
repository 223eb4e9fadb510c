"""The exact oscillator beside T + V: starts, crossings, cube and table against single runs and curves known by hand."""

from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.output.store import read
from nearharmonic_paper.config import load
from nearharmonic_paper.experiments.exact_oscillator import CHARGES, ExactOscillatorSettings
from nearharmonic_paper.experiments.exact_oscillator import reductions as times
from nearharmonic_paper.experiments.exact_oscillator.figure import exact_oscillator_charge
from nearharmonic_paper.experiments.exact_oscillator.reductions import BEST, crossing, reduce, reduction
from nearharmonic_paper.experiments.exact_oscillator.run import largest_error, measure, radius, starts_on
from nearharmonic_paper.tasks import job
from support.cubes.figure_cubes import amplitudes_of_crossing

SMALL = ExactOscillatorSettings(integrators=("aba864",), energies=5, trajectories=6, t_end="20")


@pytest.mark.parametrize("energy", [1 / 80_000, 1e-3, 1 / 8, 1 / 6])
def test_starts_lie_on_the_bounded_part_of_their_energy_surface(energy):
    """H to a few roundings of its terms, of which none is above 2 H; the corners of the triangle are at |q| = 1."""
    starts = starts_on(energy, 500, 3)
    q, p = starts[:, :2], starts[:, 4:6]
    found = nh.systems["henon_heiles"].energy(tuple(q.T), tuple(p.T))
    assert found == pytest.approx(energy, rel=8 * 2.0**-53 * 4)
    assert not starts[:, [2, 3, 6, 7]].any()
    assert np.hypot(*q.T).max() <= radius(energy) <= 1
    r = radius(energy)
    assert r * r / 2 - r**3 / 3 == pytest.approx(energy, rel=1e-13)


def test_small_surfaces_are_filled_as_a_disc_is():
    """On small surfaces V is the oscillator's: r^2 is uniform up to 2 H, and so is the angle, to 1/sqrt(n)."""
    starts = starts_on(1e-6, 4096, 1)
    share = np.sort((starts[:, 0] ** 2 + starts[:, 1] ** 2) / 2e-6)
    assert np.abs(share - (np.arange(4096) + 0.5) / 4096).max() < 1 / 64
    angle = np.sort(np.arctan2(starts[:, 1], starts[:, 0])) / (2 * np.pi) + 0.5
    assert np.abs(angle - (np.arange(4096) + 0.5) / 4096).max() < 1 / 64


def test_curves_that_are_powers_cross_where_their_exponents_say():
    """H^2 / a over H^(1/2) is 1 at a^(2/3), between points of the grid too: both are straight in the logarithm."""
    energies = np.geomspace(1e-4, 1, 9)
    for a in (1e-3, 0.02, 0.5):
        logarithms = np.log(energies**2 / a) - np.log(energies**0.5)
        assert crossing(logarithms, energies) == pytest.approx(a ** (2 / 3), rel=1e-12)
    assert crossing(np.full(9, 1.0), energies) == 0
    assert crossing(np.full(9, -1.0), energies) == np.inf
    assert crossing(np.array([-1.0, -1.0, np.inf, *[1.0] * 6]), energies) == pytest.approx(energies[1])


@pytest.mark.slow
def test_intervals_hold_crossing_and_shrink_with_number_of_trajectories():
    energies, rng, widths = np.geomspace(1e-4, 1, 9), np.random.default_rng(2), []
    for count in (40, 4000):
        noise = np.exp(rng.normal(0, 0.5, (2, 9, count)))
        found = reduced(energies, energies[:, None] ** 0.5 * noise[0], energies[:, None] ** 2 / 0.02 * noise[1])
        low, high = found.best_crossing_interval.values
        assert low < 0.02 ** (2 / 3) < high
        widths.append(np.log(high / low))
    assert widths[1] < widths[0] / 4  # a tenth, as far as 200 resamples tell


def reduced(energies, split, exact):
    """The reductions of errors (energy, trajectory) of one method that splits into T and V and one that does not."""
    over = ("energy", "trajectory")
    errors = {
        "energy_error": (("integrator", *over), [split], {"long_name": "error"}),
        "exact_energy_error": (over, exact, {"long_name": "error"}),
    }
    return reduction.of(xr.Dataset(errors, {"energy": energies}, {"seed": 5}), over="trajectory")


def test_reductions_of_equal_trajectories_have_intervals_of_zero_width():
    """H^(1/2) and H^2 / 0.02 cross at 0.02^(2/3); a trajectory that diverges leaves median and crossing alone."""
    energies = np.geomspace(1e-4, 1, 9)
    split, exact = (np.tile(curve[:, None], 20) for curve in (energies**0.5, energies**2 / 0.02))
    split[3, 7] = np.inf
    found = reduced(energies, split, exact)
    at = pytest.approx(0.02 ** (2 / 3), rel=1e-12)
    assert found.crossing.values.tolist() == [at]
    assert found.crossing_interval.values.tolist() == [[at, at]]
    assert found.best_crossing.item() == at
    assert found.energy_error.sel(quantile=0.5).values[0] == pytest.approx(energies**0.5)
    assert found.energy_error.sel(quantile=0.95).values[0].tolist() == [
        np.inf if i == 3 else e**0.5 for i, e in enumerate(energies)
    ]
    assert found.exact_energy_error.dims == ("energy", "quantile")


def made(split, exact, settings, folder):
    """Run file, cube and table."""
    path = str(folder / "run.h5")
    job.write(measure(split, exact, settings)["run"], [path], {})
    return reduce(split, exact, settings, path)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return made(("ruth", "babps8o7h"), ("aba864",), SMALL, tmp_path_factory.mktemp("small"))


def test_errors_are_those_of_single_runs_at_equal_cost(small):
    values = {name: entry.values for name, entry in small["cube"].variables.items()}
    for e in (0, 4):
        start = starts_on(float(values["energy"][e]), 6, 1)
        for c, charge in enumerate(CHARGES[:3]):
            steps = round(20 / (0.05 * charge * 7))
            errors = sorted(
                nh.integrate(
                    "henon_heiles", "aba864", 20 / steps, t_end=20, q0=row[:2], p0=row[4:6], split="exact_oscillator"
                ).max_energy_error.item()
                for row in start
            )
            assert values["exact_energy_error"][1, c, 0, e].tolist() == [errors[0], errors[3], errors[5]]
    plain = largest_error(nh.integrators["ruth"], Fraction("0.1"), Fraction(20), start, "kinetic_potential")
    assert values["energy_error"][0, 0, 4].tolist() == [np.sort(plain)[i] for i in (0, 3, 5)]


def test_table_has_row_for_each_pair_and_amplitudes_of_energies(small):
    table = small["table"]
    assert len(table.rows) == 2 * len(CHARGES) * 3
    rows = table.records()
    assert {row["T + V"] for row in rows} == {"Ruth", "BAB's8o7H", BEST}
    for row in rows:
        assert row["amplitude"] == pytest.approx((2 * row["energy"]) ** 0.5, rel=1e-15)
        assert row["energy_low"] <= row["energy_high"]


def test_legend_names_only_methods_with_a_crossing():
    cube = amplitudes_of_crossing(["aba864", "na7", "ruth"])
    cube.best_crossing[..., 1] = [np.nan, 0.0, np.inf]
    assert [text.get_text() for text in exact_oscillator_charge(cube).legends[0].texts] == ["aba864", "ruth"]


def test_crossings_between_two_charges_are_interpolated():
    energies = [[0.04, 0.01, 0.0, 0.0, 0.0]]
    cube = xr.Dataset(
        {"best_crossing": (("tau_per_stage", "exact_integrator", "charge"), [energies])},
        {"tau_per_stage": [0.1], "exact_integrator": ["a"], "charge": list(CHARGES)},
    )
    assert times.crossing_at(cube, "a", 0.1, 0.9) == 0.04
    assert times.crossing_at(cube, "a", 0.1, 1.05) == pytest.approx(0.02)
    assert times.crossing_at(cube, "a", 0.1, 1.2) == 0
    assert times.crossing_at(cube, "a", 0.1, 3.0) == 0


@pytest.mark.slow
def test_times_are_measured_and_charged(small, tmp_path, monkeypatch):
    monkeypatch.setattr(times, "LONG", 200)
    monkeypatch.setattr(times, "SHORT", 40)
    monkeypatch.setattr(times, "MEMBERS", 16)
    job.write(small["cube"], [str(tmp_path / "cube.h5")], {})
    cube = read(tmp_path / "cube.h5")
    table = times.measure_times(str(tmp_path / "cube.h5"), ("aba864",), SMALL)["table"]
    rows = table.records()
    assert [(row["runs"], row["tau_per_stage"]) for row in rows] == [
        (runs, tau) for runs in ("one trajectory", "ensemble") for tau in (0.1, 0.05)
    ]
    for row in rows:
        assert row["charge"] == pytest.approx(row["ns_exact"] / row["ns_split"])  # of the one method
        assert row["energy"] == times.crossing_at(cube, "aba864", row["tau_per_stage"], row["charge"])


CONFIG = {
    "name": "mine", "integrators": ["ruth"],
    "systems": {"sho": {"tau_per_stage": {"lowest": 0.1, "highest": 1, "points_per_decade": 2}}},
}  # fmt: skip


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"t_end": 1e9}, "exact_oscillator.trajectories = 192 is not allowed: it would take"),
        ({"energies": 1}, "exact_oscillator.energies = 1 is not allowed"),
    ],
)
def test_settings_that_make_no_sense_are_refused(section, words):
    with pytest.raises(NearharmonicError) as caught:
        load(CONFIG | {"exact_oscillator": section})
    assert words in str(caught.value)
