"""A project with a finished result, made once a process."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import result_folder


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A small finished result, for reading alone."""
    return result_folder.build(tmp_path_factory.mktemp("finished") / "results/paper")


@pytest.fixture
def project(finished, tmp_path, monkeypatch):
    """The working folder: a copy of that result, which a test may change, under the name paper."""
    shutil.copytree(finished, tmp_path / "results/paper")
    monkeypatch.chdir(tmp_path)
    return Path("results/paper")
