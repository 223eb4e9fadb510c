"""Rows of the table of methods are computed once, and then found in a cache by their dependencies."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nearharmonic.integrators import integrators
from nearharmonic_paper.experiments.paper import tableaus as overview


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of kept rows."""
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    return tmp_path


def forbidden(monkeypatch):
    monkeypatch.setattr(overview, "columns_of", lambda tableau: pytest.fail(f"{tableau.name} is made again"))


def test_rows_that_were_made_once_are_read_in_any_order(folder, monkeypatch):
    made = {name: tuple(overview.columns_of(integrators[name]).values()) for name in ("ruth", "leapfrog", "aba104")}
    header, rows = overview.overview(*made)
    forbidden(monkeypatch)
    assert overview.overview("aba104", "ruth") == (header, [made["aba104"], made["ruth"]])
    assert rows == list(made.values())


def test_a_new_method_is_added_to_those_that_are_kept(folder, monkeypatch):
    overview.overview("ruth")
    overview.overview("leapfrog")
    forbidden(monkeypatch)
    assert [row[0] for row in overview.overview("leapfrog", "ruth")[1]] == ["leapfrog", "ruth"]


@pytest.mark.parametrize("change", [{"label": "another"}, {"digits": 40}, {"order": 3}, {"first": "kick"}])
def test_a_row_of_other_facts_is_made_anew(folder, monkeypatch, change):
    overview.overview("ruth")
    ruth = integrators["ruth"]
    other = ruth.role("kick") if "first" in change else replace(ruth, **change)
    monkeypatch.setattr(overview, "registry", {"ruth": other})
    _, (row,) = overview.overview("ruth")
    assert row == tuple(overview.columns_of(other).values())


def test_rows_of_other_code_are_not_read(folder, monkeypatch):
    overview.overview("ruth")
    monkeypatch.setattr(overview, "code_digest", lambda module: "another" * 10)
    monkeypatch.setattr(overview, "columns_of", lambda tableau: {"integrator": "made again"})
    assert overview.overview("ruth")[1] == [("made again",)]


def test_a_file_that_is_damaged_is_made_again(folder, monkeypatch):
    _, before = overview.overview("ruth")
    (place,) = folder.iterdir()
    place.write_bytes(place.read_bytes()[:-7])
    assert overview.overview("ruth")[1] == before
    forbidden(monkeypatch)
    assert overview.overview("ruth")[1] == before
