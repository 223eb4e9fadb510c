"""Every file of numbers names the settings that it was made with, and these are the ones of the config."""

import json
from dataclasses import asdict
from fractions import Fraction

import pytest
import yaml

from nearharmonic.output.store import read
from nearharmonic_paper.config import load
from nearharmonic_paper.tasks.experiment import beside_the_paper
from nearharmonic_studies.trained.settings import contestants, exact_contestants, kind_of
from support.projects.targets import DECOMPOSED, MADE, METHODS, RUNS_OF, STRUCTURE_T_END, TARGETS

RESULTS = "results/tiny/"


def expected_settings(project):
    """File -> what it has to say about the settings that it was made with: the config, read without Snakemake.

    For files of an experiment that is not named here, the section of the config if they were made with settings.
    """
    given = yaml.safe_load((project.folder / "config/tiny.yaml").read_text(encoding="utf-8"))
    sweeps = {sweep.system: json.loads(json.dumps(asdict(sweep))) for sweep in load(given).sweeps}
    methods = {"integrators": list(METHODS)}
    found = {f"cubes/{system}.h5": {"sweep": sweep} | methods for system, sweep in sweeps.items()}
    for name in ("sho_terms", "linear_stability", "kinetic_energy", "structure"):
        found[f"cubes/{name}.h5"] = dict(methods)
    found["cubes/sho_terms.h5"]["integrators"] = list(DECOMPOSED)
    found["cubes/henon_heiles_chaos.h5"] = {"integrator": "babps8o7h", "t_end": 200_000}
    found["cubes/substeps_displaced.h5"] = {"integrator": "babs7o7h", "iterations": 100_000}
    found["cubes/structure.h5"]["t_end"] = STRUCTURE_T_END
    for system, t_end in STRUCTURE_T_END.items():
        found[f"runs/stability/structure/{system}.h5"] = {"system": system, "t_end": t_end} | methods
    found["cubes/work_precision.h5"] = {
        "methods": [*METHODS, *given["work_precision"]["integrators"]], "sweeps": list(sweeps.values()),
    }  # fmt: skip
    found["cubes/exact_oscillator.h5"] = {"split": list(METHODS), "exact": ["aba864"]}
    found["cubes/trained.h5"] = {"methods": list(contestants())}
    found["cubes/trained_ideas.h5"] = {"methods": list(contestants()), "exact": list(exact_contestants(["aba864"]))}
    trained = [name for name in contestants() if kind_of(name) == "trained"]
    found["runs/trained/long.h5"] = {"methods": trained, "beside": "babps8o7h"}
    for run, cube in (
        ("stability/kinetic_energy", "kinetic_energy"), ("exact_oscillator/trajectories", "exact_oscillator"),
        ("trained/proof", "trained"), ("trained/ideas", "trained_ideas"),
    ):  # fmt: skip
        found[f"runs/{run}.h5"] = found[f"cubes/{cube}.h5"]
    for name in given["stability"]:
        found[f"cubes/stability_{name}.h5"] = dict(methods)
        found |= {f"runs/stability/{name}/{method}.h5": {"integrator": method} for method in METHODS}
    for system, sweep in sweeps.items():
        for method in METHODS:
            for shard in (0, 1):
                found[f"runs/{system}/{method}/{shard}.h5"] = {"sweep": sweep, "integrator": method, "shard": shard}
    sections = load(given)
    for one in (one for one in beside_the_paper() if one.settings and not any(name in found for name in _hdf5(one))):
        section = json.loads(json.dumps(asdict(getattr(sections, one.key))))
        found |= {name: {"settings": section} for name in _hdf5(one)}
    return found


def _hdf5(experiment):
    return MADE & {*TARGETS[experiment.target], *RUNS_OF[experiment.name]} & {n for n in MADE if n.endswith(".h5")}


@pytest.mark.slow
def test_the_settings_of_an_ensemble_are_those_of_the_config(everything):
    given = yaml.safe_load((everything.folder / "config/tiny.yaml").read_text(encoding="utf-8"))["stability"]
    for name, section in given.items():
        for method in METHODS:
            path = everything.folder / RESULTS / f"runs/stability/{name}/{method}.h5"
            settings = json.loads(read(path).attrs["settings"])["settings"]
            for key, value in section.items():
                members = value if isinstance(value, dict) else {"": value}
                for member, asked in members.items():
                    stored = settings[key][member] if member else settings[key]
                    numbers = [one if isinstance(one, list) else [one] for one in (stored, asked)]
                    assert [Fraction(str(x)) for x in numbers[0]] == [Fraction(str(x)) for x in numbers[1]], (name, key)


def test_every_cube_and_run_is_planned_with_settings_of_config(drawn, planned):
    expected = expected_settings(drawn)
    settings = {
        file.removeprefix(RESULTS): job.params["task"]["settings"]
        for job in planned
        for file in job.output
        if file.endswith(".h5")
    }
    assert set(settings) == set(expected) == {name for name in MADE if name.endswith(".h5")}
    for name, asked in expected.items():
        assert {key: settings[name].get(key) for key in asked} == asked, name


def test_every_cube_and_run_was_made_with_settings_of_config(after):
    expected = expected_settings(after)
    for name in expected.keys() & after.made:
        settings = expected[name]
        stored = json.loads(read(after.folder / RESULTS / name).attrs["settings"])
        assert {key: stored.get(key) for key in settings} == settings, name
