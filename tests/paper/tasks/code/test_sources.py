"""Parsed sources are looked up by their text, in this process and in the next."""

from __future__ import annotations

import atexit

import pytest

from nearharmonic.core.machine import disk
from nearharmonic_paper.tasks import provenance as sources

TEXT = b'"""A docstring."""\nimport nearharmonic.errors\nx = 1\n'


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """A new memory each time it is called, with one place on disk; it is not written when the tests end."""
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(atexit, "register", lambda function: None)
    return sources.SourceCache


def test_the_next_process_parses_nothing_that_this_one_has_parsed(memory, monkeypatch):
    first = memory()
    found = first.parsed(TEXT)
    assert found == sources.parsed(TEXT)
    first.keep()
    monkeypatch.setattr(sources, "parsed", lambda text: pytest.fail("parsed again"))
    assert memory().parsed(TEXT) == found


def test_an_edited_text_is_another_text(memory):
    first = memory()
    first.parsed(TEXT)
    first.keep()
    edited = TEXT.replace(b"x = 1", b"x = 2")
    assert memory().parsed(edited) == sources.parsed(edited)
    assert sources.parsed(edited).digest != sources.parsed(TEXT).digest


def test_a_memory_that_is_damaged_is_forgotten(memory, tmp_path):
    first = memory()
    first.parsed(TEXT)
    first.keep()
    (place,) = tmp_path.iterdir()
    content = bytearray(place.read_bytes())
    content[-5] ^= 1
    place.write_bytes(content)
    assert memory().parsed(TEXT) == sources.parsed(TEXT)
    assert not place.exists()


def test_what_few_packages_hold_is_kept_and_more_is_not(memory, monkeypatch):
    monkeypatch.setattr(sources, "MOST_CACHED", 2)
    texts = [f"x = {i}\n".encode() for i in range(4)]
    for text in texts:
        one = memory()
        one.parsed(text)
        one.keep()
    kept = memory()
    # The first two fill it; the third begins anew, and the fourth joins it.
    assert len(kept._known) == 2
    assert [kept.parsed(text) for text in texts] == [sources.parsed(text) for text in texts]


def test_without_a_place_to_keep_it_everything_is_parsed(memory, monkeypatch):
    monkeypatch.setattr(disk, "place_of", lambda key: None)
    one = memory()
    assert one.parsed(TEXT) == sources.parsed(TEXT)
    one.keep()
