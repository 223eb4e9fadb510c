"""docs/how_to/configs.md: its config, the errors that it prints, its numbers, and its commands."""

from __future__ import annotations

import re
import shlex

import pytest
import yaml

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.config.reading import load
from support.projects.plans import planned_runs
from support.projects.workflow_project import ROOT, Project
from support.results.stated_numbers import states

PLACE = "docs/how_to/configs.md"
PAGE = (ROOT / PLACE).read_text(encoding="utf-8")
(CONFIG,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
(ERRORS,) = re.findall(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)
COMMANDS = [shlex.split(line)[1:] for line in re.findall(r"^snakemake .*$", PAGE, flags=re.MULTILINE)]
#: Changes of the config that are errors.
WRONG = (("ruth", "ruht"), ("points_per_decade", "points"), ("lowest: 0.01", "lowest: 1e-8"))


def test_config_of_the_page_is_valid_and_has_its_grid():
    config = load(yaml.safe_load(CONFIG))
    runs = planned_runs(config.sweeps, config.integrators)
    for name in config.integrators:
        count = sum(len(run.tau_per_stage) for run in runs if run.integrator == name)
        assert states(PLACE, [count], "The config above has", "for each method")


def test_three_keys_are_required():
    whole = yaml.safe_load(CONFIG)
    assert len(whole) == 3
    assert "Three keys are required." in PAGE
    for key in whole:
        with pytest.raises(NearharmonicError, match=f"lacks the key '{key}'"):
            load({name: value for name, value in whole.items() if name != key})


@pytest.mark.parametrize(("change", "line"), list(zip(WRONG, ERRORS.splitlines(), strict=True)))
def test_errors_of_the_page_are_those_of_the_config(change, line):
    assert CONFIG.count(change[0]) == 1
    with pytest.raises(NearharmonicError) as raised:
        load(yaml.safe_load(CONFIG.replace(*change)))
    assert str(raised.value).startswith(line)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The project with the config of the page in its place."""
    project = Project(tmp_path_factory.mktemp("configs") / "project")
    (project.folder / "config/mine.yaml").write_text(CONFIG, encoding="utf-8")
    return project


@pytest.mark.slow
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_commands_of_the_page_have_a_plan(written, words):
    planned = written.snakemake(*words, *([] if "-n" in words else ["-n", "--quiet", "rules"]))
    assert planned.returncode == 0, planned.stdout
    assert re.search(r"^integrate +2$", planned.stdout, flags=re.MULTILINE)


@pytest.mark.slow
def test_keys_of_a_section_are_merged_on_the_command_line(written):
    (words,) = [one for one in COMMANDS if any("t_end" in word for word in one)]
    rules = (written.folder / "Snakefile").read_text(encoding="utf-8")
    (written.folder / "shown.smk").write_text(f"{rules}\nprint('merged', *SWEEPS.values())\n", encoding="utf-8")
    done = written.snakemake(*words, "-s", "shown.smk")
    (merged,) = re.findall(r"^merged .*$", done.stdout, flags=re.MULTILINE)
    assert "t_end='50'" in merged
    assert "points_per_decade=10" in merged


@pytest.mark.slow
def test_first_try_makes_the_cube_and_the_figure_alone(written):
    (words,) = [one for one in COMMANDS if "samples=20" in one]
    done = written.snakemake(*words)
    assert done.returncode == 0, done.stdout
    folder = written.folder / "results/try"
    made = {path.relative_to(folder).with_suffix("").as_posix() for path in folder.glob("[cft]*/*")}
    # The figure of a system of the paper is stored under both of its names.
    assert made == {"cubes/henon_heiles", "figures/henon_heiles_energy_error", "figures/fig3_henon_heiles"}


@pytest.mark.slow
def test_an_error_has_status_2_and_writes_no_result(written):
    (written.folder / "config/wrong.yaml").write_text(CONFIG.replace("mine", "wrong").replace("ruth", "ruht"))
    done = written.snakemake("-j1", "--configfile", "config/wrong.yaml")
    assert done.returncode == 2
    assert "unknown integrator 'ruht'" in done.stdout
    assert not (written.folder / "results/wrong").exists()
