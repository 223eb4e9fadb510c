"""One page for all tests of the page, made from small results."""

from __future__ import annotations

import pytest

from nearharmonic.claims.page.page import page
from page_results import write_results


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """A folder of results that tests only read."""
    return write_results(tmp_path_factory.mktemp("results") / "tiny")


@pytest.fixture(scope="session")
def text(results):
    """The page of these results."""
    return page(folder=results)["page"]


@pytest.fixture(scope="session")
def place(text, tmp_path_factory):
    """The page as a file, alone in its folder."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text, encoding="utf-8")
    return path
