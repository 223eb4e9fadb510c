"""Bad configs of Snakemake: one sentence before any work, exit status 2, and nothing written."""

from __future__ import annotations

import pytest

from support.bad_input import check_message
from support.projects.workflow_project import Project

#: Lines of Snakemake about its options.
NOTES = (
    "Using workflow specific profile",
    "Assuming unrestricted shared filesystem",
    "Config file config/config.yaml is",
)
CONFIGS = {
    "name: small\nname: large\n": "the key 'name' is in lines 1 and 2",
    "name: ../x\nintegrators: [ruth]\nsystems: {sho: 5}\n": "name = '../x' is not allowed: letters, digits",
    "name: small\n": "the config lacks the key 'integrators'",
}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("project"))


def files(folder):
    """All files of a project but those that Python and Snakemake keep for themselves."""
    found = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    return {path for path in found if not {"__pycache__", ".snakemake"} & {*path.parts}}


def end(project, says, *arguments):
    before = files(project.folder)
    done = project.snakemake(*arguments)
    told = [line for line in done.stdout.splitlines() if not line.startswith(NOTES)]
    assert done.returncode == 2, done.stdout
    assert len(told) == 1, done.stdout
    check_message(told[0].removeprefix("nearharmonic: "), says)
    assert files(project.folder) == before


@pytest.mark.slow
def test_a_bad_config_ends_the_workflow_with_one_sentence(trials, project):
    bad = trials("E. bad configs")
    for i, (text, says) in enumerate(CONFIGS.items()):
        place = project.folder / "config" / f"bad{i}.yaml"
        place.write_text(text, encoding="utf-8")
        with bad.case(text):
            end(project, says, "-j2", "--configfile", f"config/bad{i}.yaml")
    with bad.case("a key of the command line"):
        end(project, "unknown key of the config 'shard'. Did you mean 'shards'?", "-j2", "--config", "shard=5")
