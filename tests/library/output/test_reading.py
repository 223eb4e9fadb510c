"""A pipe, a folder or a device in place of a file is one error at once, and never waits."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest

from nearharmonic.errors import ResultFileError
from nearharmonic.output import store
from nearharmonic.output.atomic import read_bytes, read_text
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.manifest import Texts

NO_FILES = {
    "pipe": os.mkfifo,
    "folder": os.mkdir,
    "endless device": lambda place: place.symlink_to("/dev/zero"),
    "link to itself": lambda place: place.symlink_to(place),
}


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_regular_file_is_an_error_at_once(tmp_path, kind):
    place = tmp_path / "place"
    NO_FILES[kind](place)
    with pytest.raises(OSError, match=r"not a regular file|Too many levels of symbolic links"):
        read_bytes(place)


@pytest.mark.parametrize("kind", NO_FILES)
def test_readers_of_results_name_it_in_a_sentence(tmp_path, kind):
    for name in ("manifest.json", "cubes.h5", "table.csv"):
        NO_FILES[kind](tmp_path / name)
    for read in (
        lambda: manifest.read(tmp_path),
        lambda: store.read(tmp_path / "cubes.h5"),
        lambda: Texts(tmp_path).table("table.csv"),
    ):
        with pytest.raises(ResultFileError, match="Make it again: snakemake"):
            read()


def test_regular_file_is_read_and_file_descriptors_are_closed(tmp_path):
    (tmp_path / "a").write_bytes(b"\xc3\xa9\xff")
    os.mkfifo(tmp_path / "pipe")
    before = len(list(Path("/dev/fd").iterdir()))
    for _ in range(5):
        assert read_text(tmp_path / "a", "replace") == "é\ufffd"
        with suppress(OSError):
            read_bytes(tmp_path / "pipe")
    with pytest.raises(UnicodeDecodeError):
        read_text(tmp_path / "a")
    assert len(list(Path("/dev/fd").iterdir())) == before
