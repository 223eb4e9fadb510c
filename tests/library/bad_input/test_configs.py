"""Bad configs: each ends with one sentence that names the key, before any work."""

import json
import os
from functools import partial
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.config import load, read, schema
from support.bad_input import check_message, refused, with_key
from support.projects.workflow_project import Project

# --- Bad configs: each ends with one sentence that names the key, before any work


KIND = "E. bad configs"
CASES = yaml.safe_load(Path(__file__).with_name("configs.yaml").read_text(encoding="utf-8"))
GRID = {"lowest": 0.01, "highest": 1, "points_per_decade": 5}
SMALL = {
    "name": "small",
    "integrators": ["ruth"],
    "systems": {"sho": {"tau_per_stage": GRID}, "mine": {"system": "kepler", "tau_per_stage": {**GRID, "lowest": 0.5}}},
}
#: Values that no key for a number takes.
NO_NUMBERS = [
    "", "ten", "nan", ".inf", float("nan"), float("inf"), -float("inf"), "1e999999999", "1/1e999999999", "9" * 401,
    10**400, -(10**400), "٣", "1_0", True, None, [], [1], {}, {"a": 1}, -1, "-5", "0x10", "1" * 10**5, "1e-400",
]  # fmt: skip
NUMBERS = [
    "samples", "shards", "job_seconds", "systems.sho.t_end", "systems.sho.tau_per_stage.lowest",
    "systems.sho.tau_per_stage.highest", "systems.sho.tau_per_stage.points_per_decade", "derive.starts",
    "stability.kepler.orbits", "exact_oscillator.t_end",
]  # fmt: skip
changed = partial(with_key, SMALL)
LAUGHS = ["a: &a [x, x, x, x, x, x, x, x, x]"]
LAUGHS += [f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)]
#: Files that are no config, by their contents, and words of the message.
FILES = {
    "empty.yaml": (b"", "is no config"),
    "list.yaml": (b"- name\n- systems\n", "is no config"),
    "text.yaml": (b"name", "is no config"),
    "number.json": (b"5", "is no config"),
    "binary.yaml": (bytes(range(256)), "byte 128 is no text in UTF-8"),
    "latin.yaml": ("name: é".encode("latin-1"), "is no text in UTF-8"),
    "zeros.yaml": (b"\0" * 100, "cannot be read as a config"),
    "broken.yaml": (b"name: [1, 2\nsystems: }", "in line 2"),
    "tab.yaml": (b"systems:\n\tsho: 1\n", "in line 2"),
    "colon.yaml": (b"name: a: b\n", "in line 1"),
    "broken.json": (b'{"name": "x",\n "systems": }', "systems = None"),
    "tag.yaml": (b"name: !!python/object/apply:os.system ['true']\n", "could not determine a constructor"),
    "two.yaml": (b"name: a\n---\nname: b\n", "cannot be read as a config"),
    "alias.yaml": (b"name: *nobody\n", "in line 1"),
    "cyclic.yaml": (b"name: x\nsystems: &a\n  sho: *a\n", "the alias *a in line 3 is part of what it repeats"),
    "cyclic_list.yaml": (b"name: &a [*a]\n", "part of what it repeats"),
    "laughs.yaml": ("\n".join(LAUGHS).encode(), "10000"),
    "digits.yaml": (b"name: x\nsamples: " + b"9" * 5000, "a value in it is not allowed: Exceeds the limit"),
    "no_date.yaml": (b"name: 2026-13-01\n", "a value in it is not allowed: month must be in"),
    "brackets.yaml": (b"name: " + b"[" * 5000 + b"]" * 5000, "more than 20 levels"),
    "braces.json": (b'{"a":' * 5000 + b"1" + b"}" * 5000, "more than 20 levels"),
    "dashes.yaml": (b"name:\n" + b"".join(b" " * i + b"-\n" for i in range(1, 100)), "more than 20 levels"),
    "many.yaml": (b"name: [" + b"1," * 20_000 + b"]", "10000"),
    "large.yaml": (b"# " + b"x" * 10**6, "more than 1000000 bytes"),
    "twice.yaml": (b"name: a\nname: b\n", "the key 'name' is in lines 1 and 2"),
    "inner.yaml": (b"systems:\n  sho: {a: 1}\n  sho: {a: 2}\n", "inner.yaml: the key 'sho' is in lines 2 and 3"),
    "twice.json": (b'{"name": "a", "name": "b"}', "the key 'name' is in line 1 twice"),
    "lines.json": (b'{"systems":\n\t{"a": 1,\n\t"a": 2}}', "the key 'a' is in lines 2 and 3"),
    "number_key.yaml": (b"5: a\n", "a key of the config = 5"),
    "no.yaml": (b"systems: {no: 1}\n", "a key of systems = False"),
    "null_key.yaml": (b"? \n: a\n", "a key of the config = None"),
    "list_key.yaml": (b"? [a]\n: b\n", "cannot be read as a config"),
    "date.yaml": (b"name: 2024-01-01\nintegrators: [ruth]\nsystems: {}\n", "has 2024-01-01, which YAML reads as"),
}  # fmt: skip


def test_a_bad_value_is_named_with_its_key(trials, here):
    bad = trials(KIND)
    load(SMALL)
    for key, value, says in CASES:
        with bad.case(f"{key} = {value!r}"):
            refused(partial(load, changed(key, value)), says)


def test_no_key_for_a_number_takes_anything_else(trials, here):
    bad = trials(KIND)
    for key in NUMBERS:
        for value in NO_NUMBERS:
            with bad.case(f"{key} = {str(value)[:40]}"):
                refused(partial(load, changed(key, value)), key)


def test_a_file_that_is_no_config_is_refused(trials, here):
    bad = trials(KIND)
    for name, (content, says) in FILES.items():
        path = here / name
        path.write_bytes(content)
        with bad.case(name):
            refused(partial(read, path), says)
    for path in (here, here / "missing.yaml", Path("/dev/zero"), here / ("x" * 300)):
        with bad.case(path):
            refused(partial(read, path), "cannot be read as a config")
    os.mkfifo(here / "pipe.yaml")
    with bad.case("pipe"):
        refused(partial(read, here / "pipe.yaml"), "not a regular file")


def endless():
    """Mappings of Python that hold themselves, or each other many times."""
    own = {}
    own["systems"] = own
    laughing = []
    for _ in range(18):
        laughing = [laughing] * 9
    return [own, {"name": laughing}, {**SMALL, "integrators": ["ruth"] * 10**5}]


def test_mappings_without_end_are_refused(trials, here):
    bad = trials(KIND)
    for i, mapping in enumerate(endless()):
        with bad.case(i):
            refused(partial(load, mapping))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
KEYS = sorted(
    [*schema()["properties"], "systems.sho.t_end", "systems.sho.precision", "systems.sho.tau_per_stage",
     "systems.mine.q0", "systems.mine.parameters", "systems.mine.file", "stability.kepler", "stability.rounding.steps"]
)  # fmt: skip


def test_any_value_is_accepted_or_refused_in_one_line(trials, here):
    bad = trials(KIND)

    @settings(max_examples=100, database=None, derandomize=True)
    @given(st.sampled_from(KEYS), VALUES)
    def check(key, value):
        with bad.case(f"{key} = {value!r}"):
            try:
                load(changed(key, value))
            except NearharmonicError as error:
                check_message(str(error))

    check()


def test_any_file_is_accepted_or_refused_in_one_line(trials, here):
    bad = trials(KIND)
    whole = yaml.safe_dump(SMALL).encode()

    @settings(max_examples=60, database=None, derandomize=True)
    @given(st.integers(0, len(whole)), st.integers(0, 20), st.binary(max_size=8) | st.sampled_from(b"{[&*!|:-#\t\"'"))
    def check(begin, length, middle):
        middle = bytes([middle]) if isinstance(middle, int) else middle
        path = here / "any.yaml"
        path.write_bytes(whole[:begin] + middle + whole[begin + length :])
        with bad.case(path.read_bytes()):
            try:
                read(path)
            except NearharmonicError as error:
                check_message(str(error).replace(str(here), ""))

    check()


def test_json_is_read_as_well(here):
    path = here / "good.json"
    path.write_text(json.dumps(SMALL, indent="\t"), encoding="utf-8")
    assert read(path) == load(SMALL)


# --- Bad configs of Snakemake: one sentence before any work, exit status 2, and nothing written


#: Lines of Snakemake about its options.
NOTES = (
    "Using workflow specific profile",
    "Assuming unrestricted shared filesystem",
    "Config file config/config.yaml is",
)
FINE = "systems: {sho: {tau_per_stage: {lowest: 1.0e-12, highest: 1, points_per_decade: 5}}}"
CONFIGS = {
    f"name: small\nintegrators: [rut]\n{FINE}\n": "unknown integrator 'rut'. Did you mean 'ruth'?",
    f"name: small\nintegrators: [ruth]\n{FINE}\n": "t_end = 500 would take 166666666666667 steps",  # by the plan
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


@pytest.mark.parametrize("some", [slice(0, 2), pytest.param(slice(2, None), marks=pytest.mark.slow)], ids=str)
def test_a_bad_config_ends_the_workflow_with_one_sentence(trials, project, some):
    bad = trials("E. bad configs")
    for text, says in list(CONFIGS.items())[some]:
        (project.folder / "config/bad.yaml").write_text(text, encoding="utf-8")
        with bad.case(text):
            end(project, says, "-j2", "--configfile", "config/bad.yaml")


@pytest.mark.slow
def test_a_bad_key_of_the_command_line_is_one_sentence(project):
    end(project, "unknown key of the config 'shard'. Did you mean 'shards'?", "-j2", "--config", "shard=5")
