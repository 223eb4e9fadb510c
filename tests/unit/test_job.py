"""A job's log holds all that it prints; the terminal hears one sentence when it fails."""

from __future__ import annotations

import sys

import pytest

from nearharmonic.errors import ResultFileError
from nearharmonic.job import logged


def test_what_a_job_prints_goes_to_its_log(tmp_path, capsys):
    with logged(str(tmp_path / "log")):
        sys.stdout.write("out\n")
        sys.stderr.write("err\n")
    assert (tmp_path / "log").read_text() == "out\nerr\n"
    assert capsys.readouterr() == ("", "")


def test_an_error_of_the_family_ends_a_job_with_its_own_words(tmp_path):
    with pytest.raises(SystemExit, match=r"^0\.h5 is truncated$"), logged(str(tmp_path / "log")):
        raise ResultFileError("0.h5 is truncated")
    assert (tmp_path / "log").read_text() == "0.h5 is truncated\n"


def test_any_other_error_leaves_its_traceback_in_the_log(tmp_path):
    place = str(tmp_path / "log")
    with pytest.raises(SystemExit) as end, logged(place):
        raise ZeroDivisionError("by nought")
    assert str(end.value) == f"ZeroDivisionError: by nought (traceback in {place})"
    assert "Traceback" in (tmp_path / "log").read_text()
