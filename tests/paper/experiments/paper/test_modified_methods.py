"""Methods with kicks of a modified potential, and processed ones, in a config: from the plan to the figures."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.output.store import write
from nearharmonic_paper.config import load
from nearharmonic_paper.experiments.paper.decompose import decompose
from nearharmonic_paper.experiments.paper.figures import fig2_decomposition
from nearharmonic_paper.experiments.paper.plan import shards_of
from nearharmonic_paper.experiments.paper.reduce import reduce
from nearharmonic_paper.experiments.paper.run import integrate
from nearharmonic_paper.experiments.paper.tableaus import overview

METHODS = ("ruth", "rowlands", "chin_4a", "trained_modified")
GRID = {"lowest": 0.04, "highest": 0.4, "points_per_decade": 3}
CONFIG = {
    "name": "modified",
    "integrators": list(METHODS),
    "systems": {
        "sho": {"t_end": 20, "tau_per_stage": GRID},
        "henon_heiles": {"t_end": 20, "tau_per_stage": GRID, "precision": ["double", "extended"]},
    },
    "samples": 11,
}


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    config, folder, found = load(CONFIG), tmp_path_factory.mktemp("modified"), {}
    for sweep in config.sweeps:
        files = {name: [] for name in config.methods}
        for name in config.methods:
            for index in range(shards_of(sweep, name)):
                made = integrate(sweep, name, index)["run"]
                files[name].append(folder / f"{sweep.system}_{name}_{index}.h5")
                write(files[name][-1], made.variables, made.attributes, made.groups, coordinates=made.coordinates)
        found[sweep.system] = reduce(sweep, config.methods, **files)["cube"]
    return found


@pytest.mark.filterwarnings("ignore:tau = .* runs as")
@pytest.mark.parametrize("system", ["sho", "henon_heiles"])
@pytest.mark.parametrize("name", METHODS)
def test_a_cube_has_the_errors_and_evaluations_of_single_runs(cubes, system, name):
    precision = str(cubes[system].precision.values[-1])
    runs = cubes[system].sel(integrator=name, precision=precision)
    for tau in runs.tau_per_stage.values.tolist():
        one = nh.integrate(system, name, tau * nh.integrators[name].stages, t_end=20, samples=11, precision=precision)
        same = runs.sel(tau_per_stage=tau)
        assert same.max_energy_error == one.max_energy_error
        assert same.evaluations == one.evaluations
        # Blocks of a run have one step more or less; the mean of blocks is one over steps.
        assert float(same.mean_energy_error) == pytest.approx(float(one.mean_energy_error), rel=0.1)


def test_role_that_modified_kick_does_not_have_has_no_terms():
    terms = decompose(METHODS)["cube"]
    drawn = fig2_decomposition(terms)
    assert drawn.legends
    plt.close("all")
    there = np.isfinite(terms.kappa).any("order").to_series()
    assert [bool(there["ruth", first]) for first in ("drift", "kick")] == [True, True]
    for name in METHODS[1:]:
        first = nh.integrators[name].first
        assert {role: bool(there[name, role]) for role in ("drift", "kick")} == {
            role: role == first for role in ("drift", "kick")
        }


def test_table_of_all_methods_omits_entries_for_any_kinetic_energy():
    header, rows = overview("chin_4a", "ruth")
    chin, ruth = (dict(zip(header, row, strict=True)) for row in rows)
    empty = {"generalised order", "leading error", "leading error norm", "effective error"}
    assert {name for name in header if chin[name] == ""} == empty
    assert not any(ruth[name] == "" for name in header)
    assert (chin["order"], chin["Nystrom order"], chin["Nystrom leading error"]) == (4, 4, 5)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ({"relativistic_oscillator": {"tau_per_stage": GRID}}, "it requires a quadratic kinetic energy"),
        ({"kepler_regularised": {"tau_per_stage": GRID}}, "it is regularised"),
        (
            {"exact": {"system": "henon_heiles", "split": "exact_oscillator", "tau_per_stage": GRID}},
            "it has its oscillators solved exactly",
        ),
    ],
)
def test_config_with_system_without_modified_kicks_is_refused(system, words):
    with pytest.raises(SettingError, match=words) as refused:
        load(CONFIG | {"integrators": ["ruth", "chin_4a"], "systems": system})
    assert "integrator = 'chin_4a' is not allowed" in str(refused.value)


def test_oscillators_are_not_solved_exactly_by_method_with_modified_kicks():
    with pytest.raises(SettingError, match=r"integrator = 'rowlands' .* oscillators solved exactly"):
        load(CONFIG | {"exact_oscillator": {"integrators": ["aba864", "rowlands"]}})


def test_what_measures_energy_at_every_step_leaves_processed_methods_out():
    config = load(CONFIG)
    assert config.methods == METHODS
    assert config.stepwise == ("ruth", "chin_4a", "trained_modified")
    assert "chin_4a" not in load(CONFIG | {"integrators": ["ruth"]}).compared
