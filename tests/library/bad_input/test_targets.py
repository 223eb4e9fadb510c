"""Misspelt targets and bad configs of Snakemake: one sentence before any work, exit status 2, and nothing written."""

from __future__ import annotations

from functools import partial

import pytest

from nearharmonic_paper.config.targets import check_targets
from support.bad_input import check_message, refused
from support.projects.workflow_project import Project

KIND = "E. bad command lines"
#: Lines of Snakemake about its options.
NOTES = (
    "Using workflow specific profile",
    "Assuming unrestricted shared filesystem",
    "Config file config/config.yaml is",
)
TARGETS = {
    "fig7": "unknown target 'fig7'. Did you mean 'fig6'?",
    "everything_else": "unknown target 'everything_else'. Did you mean 'everything'?",
    "fig_1": "Did you mean 'fig1'?",
    "results/tiny/cubes/keplr.h5": "Did you mean 'results/tiny/cubes/kepler.h5'?",
    "integrate": "target = 'integrate' is not allowed: a file of this rule, results/tiny/runs/{system}/{integrator}/",
    "README.md": "unknown target 'README.md'",
}
CONFIGS = {
    "name: small\nname: large\n": "the key 'name' is in lines 1 and 2",
    "name: ../x\nintegrators: [ruth]\nsystems: {sho: 5}\n": "name = '../x' is not allowed: letters, digits",
    "name: small\n": "the config lacks the key 'integrators'",
}
#: Eight lists, each of which is the one before 99 times.
LAUGHS = b"a: &a [x, x]\n"
LAUGHS += b"".join(b"%c: &%c [%s]\n" % (n, n, b", ".join([b"*%c" % (n - 1)] * 99)) for n in b"bcdefgh")
#: Files that Snakemake cannot read, or runs, if it comes to read them.
UNREADABLE = {
    "cyclic": (b"name: x\nsystems: &a\n  sho: *a\n", "the alias *a in line 3 is part of what it repeats"),
    "deep": (b"name: " + b"[" * 5000 + b"]" * 5000, "more than 20 levels"),
    "binary": (bytes(range(256)), "byte 128 is no text in UTF-8"),
    "laughs": (LAUGHS, "10000"),
    "template": (b"__use_yte__: true\nname: ?open('ran', 'w').close()\n", "__use_yte__ = True is not allowed"),
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


def end_unreadable(bad, project, name):
    content, says = UNREADABLE[name]
    place = project.folder / f"config/{name}.yaml"
    place.write_bytes(content)
    with bad.case(name):
        end(project, says, "-j2", "--configfile", f"config/{name}.yaml")


class Rule:
    """A rule with one output, of which ``is_producer`` knows the name alone."""

    def __init__(self, name, output):
        self.name, self.output = name, [output]

    def has_wildcards(self):
        return "{" in self.output[0]

    def is_producer(self, file):
        return file == self.output[0]


RULES = [Rule("integrate", "results/tiny/runs/{system,sho|kepler}/{integrator}/{shard,[0-9]+}.h5")]
RULES += [Rule(name, f"results/tiny/{name}") for name in ("all", "everything", "fig1", "fig6")]


def test_an_unknown_target_is_refused_with_its_nearest_match(trials):
    bad = trials(KIND)
    for target, says in TARGETS.items():
        with bad.case(target):
            for targets in ([target], ["fig1", "results/tiny/all", target]):
                call = partial(check_targets, targets, RULES, lambda: ["results/tiny/cubes/kepler.h5"])
                check_message(refused(call, says))


def test_former_name_of_a_target_warns_with_its_present_name():
    rules = [*RULES, Rule("beyond", "results/tiny/beyond")]
    with pytest.warns(FutureWarning, match="^the target beyond is now sixth_order$"):
        check_targets(["fig1", "beyond"], rules, list)
    check_targets(["fig1"], rules, list)  # a warning would be an error here


@pytest.mark.slow
def test_the_workflow_refuses_a_target_before_any_work(trials, project):
    with trials(KIND).case("everything_else"):
        end(project, TARGETS["everything_else"], "fig1", "everything_else", "-j2", "--configfile", "config/tiny.yaml")


def test_a_config_is_checked_before_snakemake_reads_it(trials, project):
    end_unreadable(trials("E. bad configs"), project, "template")


@pytest.mark.slow
def test_configs_that_snakemake_cannot_read_end_with_one_sentence(trials, project):
    bad = trials("E. bad configs")
    for name in UNREADABLE:
        end_unreadable(bad, project, name)
    with bad.case("folder"):
        end(project, "config cannot be read as a config: not a regular file", "-n", "--configfile", "config")
    with bad.case("missing"):
        end(project, "config/none.yaml cannot be read as a config", "-n", "--configfile", "config/none.yaml")
    with bad.case("target behind"):
        end(project, "a target is written before --configfile", "-n", "--configfile", "config/smoke.yaml", "fig3")


@pytest.mark.long
def test_the_workflow_refuses_each_target_before_any_work(trials, project):
    bad = trials(KIND)
    for target, says in TARGETS.items():
        with bad.case(target):
            end(project, says, target, "-n", "--configfile", "config/tiny.yaml")


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
