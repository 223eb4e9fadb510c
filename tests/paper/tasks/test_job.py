"""A job's log holds all that it prints; the terminal hears one sentence when it fails."""

from __future__ import annotations

import re
import sys
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr

from nearharmonic.errors import ResultFileError
from nearharmonic.output.store import read
from nearharmonic_paper.tasks.job import Files, FrozenJob, draw, logged, write
from nearharmonic_paper.tasks.provenance import task


def test_what_a_job_prints_goes_to_its_log(tmp_path, capsys):
    with logged(str(tmp_path / "log")):
        sys.stdout.write("out\n")
        sys.stderr.write("err\n")
    assert (tmp_path / "log").read_text() == "out\nerr\n"
    assert capsys.readouterr() == ("", "")


def test_error_of_family_ends_job_with_its_own_words(tmp_path):
    with pytest.raises(SystemExit, match=r"^0\.h5 is truncated$"), logged(str(tmp_path / "log")):
        raise ResultFileError("0.h5 is truncated")
    assert (tmp_path / "log").read_text() == "0.h5 is truncated\n"


def test_any_other_error_leaves_its_traceback_in_the_log(tmp_path):
    place = str(tmp_path / "log")
    with pytest.raises(SystemExit) as end, logged(place):
        raise ZeroDivisionError("by zero")
    assert str(end.value) == f"ZeroDivisionError: by zero (traceback in {place})"
    assert "Traceback" in (tmp_path / "log").read_text()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_full_disk_under_the_log_does_not_hide_the_error(tmp_path):
    (tmp_path / "log").symlink_to("/dev/full")
    stack = ExitStack()
    stack.enter_context(logged(str(tmp_path / "log")))
    sys.stdout.write("out\n" * 10_000)
    error = ResultFileError("0.h5 is truncated")
    with pytest.raises(SystemExit, match=r"^0\.h5 is truncated$"):
        stack.__exit__(ResultFileError, error, None)


def test_log_that_cannot_be_made_ends_job_with_sentence(tmp_path):
    with pytest.raises(SystemExit, match=r" cannot be written: Is a directory$"), logged(str(tmp_path)):
        sys.stdout.write("out\n")
    with pytest.raises(SystemExit, match=r"^.* cannot be written: No such file or directory$"), logged("none/log"):
        sys.stdout.write("out\n")


def test_dataset_goes_to_hdf5_file_though_it_is_mapping(tmp_path):
    cube = xr.Dataset({"error": ("tau", [1.0, 2.0], {"units": "1", "long_name": "error"})})
    write(cube, [str(tmp_path / "cube.h5")], {"settings": "{}"})
    assert read(tmp_path / "cube.h5").error.values.tolist() == [1.0, 2.0]


@pytest.mark.slow
@pytest.mark.parametrize("background", [{}, pytest.param({"transparent": True}, marks=pytest.mark.slow)])
def test_job_draws_svg_file_with_background_that_its_rule_asks(tmp_path, background):
    function = "nearharmonic_paper.experiments.paper.figures:fig6_substeps"
    place = str(tmp_path / "results/x/figures/fig6_substeps.svg")
    log = tmp_path / "results/x/logs/draw.log"
    log.parent.mkdir(parents=True)
    draw(
        FrozenJob(
            input=Files([], {}),
            output=Files([place], {"fig6": [place]}),
            params=SimpleNamespace(tasks={"fig6": task(function)}, captions={"fig6": "Six. Two."}, **background),
            log=[str(log)],
            threads=1,
            patience=0,
        )
    )
    text = Path(place).read_text(encoding="utf-8")
    (sheet,) = re.findall(r'<g id="patch_1">\s*<path [^>]*style="([^"]*)"', text)
    assert sheet == ("fill: none" if background else "fill: #ffffff")
