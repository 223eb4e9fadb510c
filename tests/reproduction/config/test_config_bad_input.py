"""Invalid configs and files of systems: each is refused in one sentence, for all types that YAML reads."""

from __future__ import annotations

from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.reproduction.config.reading import load

GRID = {"lowest": 0.05, "highest": 0.5, "points_per_decade": 4}
WELL = (Path(__file__).parents[3] / "examples" / "quartic_well.py").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    (tmp_path / "quartic_well.py").write_text(WELL)
    monkeypatch.chdir(tmp_path)
    with nh.systems.defining({}), nh.integrators.defining({}):
        yield tmp_path


def refused(systems):
    with pytest.raises(NearharmonicError) as caught:
        load({"name": "mine", "integrators": ["ruth"], "systems": systems})
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"q0": [[1], [2]]}, "systems.mine.q0[0] = [1]"),
        ({"q0": ["1", "1e-999999999"]}, "systems.mine.q0[1] = '1e-999999999'"),
        ({"q0": [10**5000, 0]}, "systems.mine.q0[0] = a number of type int"),
        ({"parameters": {"b": [1, 2]}}, "systems.mine.parameters.b"),
        ({"parameters": {"b": {}}}, "systems.mine.parameters.b = {}"),
        ({"parameters": {3: "1"}}, "a key of systems.mine.parameters = 3"),
        ({"file": "a" * 300 + ".py"}, "no such file"),
    ],
)
def test_entries_of_another_type_are_refused_by_their_keys(given, words):
    assert words in refused({"mine": {"file": "quartic_well.py", "tau_per_stage": GRID} | given})


@pytest.mark.parametrize("key", [3, None, True])
def test_a_key_that_is_no_text_is_refused(key):
    assert f"a key of systems = {key}" in refused({key: {"file": "quartic_well.py", "tau_per_stage": GRID}})


def test_misspelt_key_is_told_before_one_that_is_missing():
    said = refused({"mine": {"file": "quartic_well.py", "tau_per_stag": GRID}})
    assert "unknown key of systems.mine 'tau_per_stag'. Did you mean 'tau_per_stage'?" in said


@pytest.mark.parametrize("name", ["TABLEAUX", "tableau"])
def test_file_of_integrators_under_another_name_is_told_near_miss(folder, name):
    text = (Path(__file__).parents[3] / "examples" / "fourth_order.py").read_text(encoding="utf-8")
    (folder / "method.py").write_text(text.replace("TABLEAU =", f"{name} ="))
    with pytest.raises(NearharmonicError, match=f"did you mean its '{name}'"):
        load({"name": "mine", "integrators": ["method.py"], "systems": {"sho": {"tau_per_stage": GRID}}})
