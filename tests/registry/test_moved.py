"""Modules by their old names."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import nearharmonic
from nearharmonic.registry.moved import MOVED, new_name

ROOT = Path(nearharmonic.__file__).parent


@pytest.mark.parametrize("old", ["output.style", "config", "engine.statistics", "claims", "systems.quantities"])
def test_an_old_name_is_the_new_module_and_warns_once(old):
    with pytest.warns(DeprecationWarning, match=f"nearharmonic.{old} is now {new_name(f'nearharmonic.{old}')}"):
        found = import_module(f"nearharmonic.{old}")
    assert found is import_module(new_name(f"nearharmonic.{old}"))
    assert found.__spec__.name == found.__name__ == new_name(f"nearharmonic.{old}")
    assert import_module(f"nearharmonic.{old}") is found  # no second warning, which would be an error here


def test_every_new_name_exists_and_no_old_one():
    for old, new in MOVED.items():
        places = [ROOT.joinpath(*name.partition(":")[0].split(".")) for name in (old, new)]
        there = [place.with_suffix(".py").is_file() or (place / "__init__.py").is_file() for place in places]
        assert there == [False, True], old


def test_a_name_that_never_was_is_no_module():
    with pytest.raises(ModuleNotFoundError):
        import_module("nearharmonic.nothing")


@pytest.mark.slow
def test_a_warning_shows_the_line_that_imports():
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", "from nearharmonic.output.style import house_style"],
        capture_output=True, text=True, check=True, env={"PYTHONPATH": str(ROOT.parent)},
    )  # fmt: skip
    assert "nearharmonic.output.style is now nearharmonic.plotting.style" in done.stderr


def test_an_old_name_of_a_mapping_is_that_mapping():
    with pytest.warns(DeprecationWarning, match="is now nearharmonic.integrators.modified_integrators"):
        found = import_module("nearharmonic.modified_integrators")
    assert found is nearharmonic.modified_integrators is nearharmonic.integrators.modified_integrators
    assert nearharmonic.integrators.__spec__.name == "nearharmonic.integrators"


def test_types_of_methods_are_found_at_their_old_places():
    found = {}
    for old in ("modified", "modified_tableau", "processed_tableau"):
        with pytest.warns(DeprecationWarning, match=f"nearharmonic.integrators.{old} is now nearharmonic.integrators"):
            found[old] = import_module(f"nearharmonic.integrators.{old}")
    assert found["modified_tableau"].ModifiedTableau is nearharmonic.Tableau
    assert found["processed_tableau"].ProcessedTableau is nearharmonic.Tableau
    assert isinstance(
        found["modified"].modified_integrators["rowlands"].processor, found["processed_tableau"].Processor
    )


def test_former_name_of_type_is_that_type_and_warns_once():
    vars(nearharmonic).pop("ModifiedTableau", None)
    with pytest.warns(DeprecationWarning, match="^nearharmonic.ModifiedTableau is now nearharmonic.Tableau$"):
        assert nearharmonic.ModifiedTableau is nearharmonic.Tableau
    assert nearharmonic.ModifiedTableau is nearharmonic.Tableau  # no second warning, which would be an error here
    assert "ModifiedTableau" not in nearharmonic.__all__
    del nearharmonic.ModifiedTableau
