"""Configs: defaults, and a schema that documents itself; tests/library/bad_input has the refusals."""

from __future__ import annotations

import copy
import re
from decimal import Decimal
from functools import partial
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator
from snakemake.cli import parse_config

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.config import key_table, load, read, schema, warn_of_name
from support.bad_input import with_key

ROOT = Path(__file__).parents[3]
SCHEMA = schema()
SMALL = {
    "name": "small",
    "integrators": ["ruth", "aba864"],
    "systems": {
        "sho": {"tau_per_stage": {"lowest": 0.01, "highest": 1, "points_per_decade": 5}},
        "kepler": {"t_end": 8766, "tau_per_stage": {"lowest": 1, "highest": 100, "points_per_decade": 5}},
    },
}
GRID = "systems.sho.tau_per_stage"
changed = partial(with_key, SMALL)


def test_keys_that_are_not_given_have_their_defaults():
    config = load(SMALL)
    sho, kepler = config.sweeps
    assert (sho.t_end, sho.precision, sho.summation) == ("500", ("double",), "compensated")
    assert (sho.samples, sho.shards, kepler.t_end) == (500, 1, "8766")
    assert config.decomposed == config.integrators == ("ruth", "aba864")


def test_a_config_is_left_as_it_was_given():
    given = copy.deepcopy(SMALL)
    load(given)
    assert given == SMALL


def test_decimal_strings_are_numbers_for_yaml_misreads_1e_4():
    assert yaml.safe_load("1e-2") == "1e-2"
    assert load(changed(f"{GRID}.lowest", "1e-2")) == load(SMALL)


def test_of_two_faults_one_nearer_to_top_is_told():
    config = changed(f"{GRID}.lowst", 2) | {"shards": 0}
    with pytest.raises(NearharmonicError, match="shards = 0"):
        load(config)


def properties(schema):
    for member in schema.get("properties", {}).values():
        yield member
        yield from properties(member)
    other = schema.get("additionalProperties")
    if isinstance(other, dict):
        yield other
        yield from properties(other)


def test_the_schema_is_one_and_describes_every_key():
    Draft202012Validator.check_schema(SCHEMA)
    assert all({"description", "allowed", "type"} <= set(m) or "enum" in m for m in properties(SCHEMA))


def test_no_level_of_the_schema_lets_unknown_keys_pass():
    levels = [SCHEMA, *(m for m in properties(SCHEMA) if m.get("type") == "object")]
    assert all("additionalProperties" in level for level in levels)


def test_the_table_of_keys_in_the_documentation_is_the_schema():
    assert key_table(SCHEMA) in (ROOT / "config/README.md").read_text(encoding="utf-8")


def test_the_schema_file_is_that_of_the_types():
    assert yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text(encoding="utf-8")) == SCHEMA


@pytest.mark.parametrize("file", ["config.yaml", "smoke.yaml"])
def test_schema_takes_shipped_configs_and_refuses_what_loading_refuses(file):
    shipped = yaml.safe_load((ROOT / "config" / file).read_text(encoding="utf-8"))
    schema_validator = Draft202012Validator(SCHEMA)
    assert schema_validator.is_valid(shipped)
    for key, value in (("samples", -1), ("shards", "many"), ("integrators", []), ("summation", "kahan"), ("sharsd", 2)):
        assert not schema_validator.is_valid(shipped | {key: value})


def test_numbers_may_be_given_as_text_as_on_command_line():
    text = changed(GRID, {"lowest": "0.01", "highest": "1", "points_per_decade": "5"}) | {"samples": "10"}
    assert load(text) == load(SMALL | {"samples": 10})


def test_a_whole_number_may_be_written_with_a_point():
    assert load(SMALL | {"samples": 10.0}).samples == 10


@pytest.mark.parametrize(
    ("written", "misread"),
    [
        ("010", "8"), ("1:30", "90"), ("0x1F", "31"), ("0b11", "3"), ("1_000", "1000"), ("1_0.5", "10.5"),
        (".inf", "inf"), ("2026-01-01", "2026-01-01"), ("190:20:30.15", "685230.15"), ("!!int '010'", "8"),
        ("0.12345678901234567890", "0.12345678901234568"), ("yes", "True"), ("~", "None"),
        *((text, None) for text in ("08", "1e1", "+8", "8.", "1.25", "8.0e+0", "'010'", "!!str 010")),
        ("'1.00000000000000001'", None),
    ],
)  # fmt: skip
def test_number_of_a_file_is_its_decimal_digits_or_refused(tmp_path, written, misread):
    path, digits = tmp_path / "mine.yaml", re.sub(r"!!\w+ |'", "", written)
    path.write_text(yaml.safe_dump(changed("systems.sho.t_end", "END")).replace("END", written))
    if misread is None:
        assert Decimal(read(path).systems["sho"].t_end) == Decimal(digits)
        return
    says = rf"has {re.escape(digits)}, which YAML reads as the \w+ {re.escape(misread)}: numbers have decimal digits"
    with pytest.raises(NearharmonicError, match=rf"{says}|t_end = {misread} is not allowed: a finite number above 0"):
        read(path)


def test_number_of_command_line_is_its_decimal_digits_or_refused():
    """``snakemake --config``, which reads numbers with Python, and text inside of sections without types."""
    given = parse_config(["samples=010", "job_seconds=08.5", "derive={starts: 010}"])
    config = load(SMALL | given)
    assert (config.samples, config.job_seconds, config.derive.starts) == (10, 8.5, 10)
    for entry in ("samples=0x1F", "samples=1:30", "job_seconds=inf", "job_seconds=yes", "derive={starts: 1_000}"):
        with pytest.raises(NearharmonicError, match=rf"{entry[:6]}.* is not allowed: an? "):
            load(SMALL | parse_config([entry]))


@pytest.mark.parametrize(
    ("name", "place", "warns"),
    [("paper", "mine.yaml", True), ("paper", "/copy/config/config.yaml", False), ("mine", "mine.yaml", False)],
)
def test_name_of_the_paper_warns_in_another_config(capsys, name, place, warns):
    warn_of_name(name, [place])
    said = capsys.readouterr().err
    assert said.startswith("nearharmonic: warning: name = 'paper' is the name of config/config.yaml") is warns
    assert bool(said) is warns


def test_fitting_trajectories_share_one_file_and_others_are_split():
    assert {sweep.shards for sweep in load(SMALL).sweeps} == {1}
    many = load(SMALL | {"samples": 10**6}).sweeps[0]  # 11 runs of 40 MB; a job holds at most 400 MB
    assert many.shards == 2


def test_a_section_that_is_not_given_has_all_its_defaults():
    assert load(SMALL).stability == load(SMALL | {"stability": {"kepler": {}}}).stability
    assert load(SMALL | {"derive": {"starts": 5}}).derive.family_starts == load(SMALL).derive.family_starts
