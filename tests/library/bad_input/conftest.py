"""Fixtures of bad input."""

import pytest


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder beside an empty working directory, which stays empty."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    yield tmp_path
    assert not list(folder.iterdir())
