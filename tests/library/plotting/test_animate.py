"""``nh.animate``: films of trajectories in complete files that need no network, and nothing for other arguments."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import nearharmonic as nh
from nearharmonic.errors import FileWriteError, SettingError
from nearharmonic.plotting.drawing import truncator


@pytest.fixture(scope="module")
def run():
    return nh.integrate("henon_heiles", "ruth", 0.5, t_end=20, samples=21)


def frames_of(page):
    """Pictures of an HTML page, as bytes of PNG files in base64."""
    return re.findall(r"'(iVBORw0KGgo[A-Za-z0-9+/=]+)'", page)


@pytest.mark.slow
def test_gif_file_has_number_of_frames_at_asked_rate(run, tmp_path):
    place = nh.animate(run, tmp_path / "deeper" / "orbit.gif", frames=5, fps=10)
    content = place.read_bytes()
    assert content.startswith(b"GIF89a")
    with Image.open(BytesIO(content)) as film:
        assert (film.n_frames, film.info["duration"], film.info["loop"]) == (5, 100, 0)
        shown = []
        for k in range(5):
            film.seek(k)
            shown.append(np.asarray(film.convert("RGB")))
    assert not any(np.array_equal(one, other) for one, other in pairwise(shown))
    assert [path.name for path in place.parent.iterdir()] == ["orbit.gif"]


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["gif", "html"])
def test_film_has_the_same_bytes_each_time(run, tmp_path, ending):
    one, other = (nh.animate(run, tmp_path / f"{name}.{ending}", frames=3) for name in ("one", "other"))
    assert one.read_bytes() == other.read_bytes()


class Requests(HTMLParser):
    """Addresses that a page asks for."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found += [value for name, value in attributes if name in ("src", "href", "srcset", "data", "action")]


@pytest.mark.slow
def test_html_page_holds_every_frame_and_asks_for_nothing(run, tmp_path):
    place = nh.animate(run, tmp_path / "orbit.html", frames=4, title="A & <B>")
    page = place.read_text(encoding="utf-8")
    assert len(set(frames_of(page))) == 4
    assert Requests(page).found == []
    assert not re.search(r"https?:|url\(|@import|fetch\(|XMLHttp", page)
    assert "<title>A &amp; &lt;B&gt;</title>" in page


@pytest.mark.slow
def test_without_file_notebook_shows_page(run):
    film = nh.animate(run, frames=2)
    assert film.startswith("<!DOCTYPE html>")
    shown = film._repr_html_()
    assert shown.startswith("<iframe ")
    assert "<script>" not in shown


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_orbit_and_errors_end_at_time_of_frame(run, share):
    figure = nh.plot(run)
    truncator(figure, [run])(share)
    energy, orbit = figure.axes
    passed = run.t.values <= share * 20 * (1 + 1e-9)
    np.testing.assert_array_equal(energy.lines[0].get_xdata(), run.t.values[passed])
    np.testing.assert_allclose(energy.lines[0].get_ydata(), abs(run.energy_error.values[passed]))
    last = run.q.values[passed][-1]
    assert orbit.lines[0].get_xydata()[-1] == pytest.approx(last)
    assert orbit.lines[-1].get_xydata().tolist() == [pytest.approx(last)]
    assert orbit.get_title(loc="right") == f"$t$ = {20 * share:.4g}"
    assert orbit.get_position().y0 > energy.get_position().y1
    assert orbit.get_title(loc="left").startswith(r"$\mathbf{A}$")


def test_two_runs_are_cut_at_the_same_time(run):
    other = nh.integrate("henon_heiles", "aba864", 0.5, t_end=10, samples=41)
    figure = nh.plot([run, other])
    truncator(figure, [run, other])(0.25)
    assert [line.get_xdata()[-1] for line in figure.axes[0].lines[:2]] == [5, 5]


@pytest.mark.parametrize(
    ("what", "settings", "says"),
    [
        (None, {"path": "orbit.mp4"}, "path = 'orbit.mp4' is not allowed: .* ends with .gif or .html"),
        (None, {"path": "orbit"}, "path = 'orbit' is not allowed"),
        (None, {"frames": 1}, "frames = 1 is not allowed: an integer from 2 to 2000"),
        (None, {"fps": 0.5}, "fps = 0.5 is not allowed"),
        (lambda: nh.sweep("sho", "ruth", [0.1, 0.2], t_end=5), {}, "a Dataset of nearharmonic.integrate, or a list"),
        (list, {}, "a Dataset of nearharmonic.integrate, or a list"),
        (lambda: nh.integrate("sho", "ruth", 0.1, t_end=5, energy="none"), {}, "there are no energy errors"),
    ],
)
def test_other_arguments_are_refused_before_any_work(run, tmp_path, monkeypatch, what, settings, says):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SettingError, match=says):
        nh.animate(run if what is None else what(), **settings)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_film_that_fails_leaves_the_earlier_file(run, tmp_path, monkeypatch):
    place = tmp_path / "orbit.gif"
    place.write_bytes(b"old")

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(FigureCanvasAgg, "print_png", fail)
    with pytest.raises(MemoryError):
        nh.animate(run, place, frames=2)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"orbit.gif": b"old"}
    monkeypatch.undo()
    with pytest.raises(FileWriteError):
        nh.animate(run, place / "below.html", frames=2)


def test_films_need_no_pyplot():
    program = "import nearharmonic as nh, sys; nh.animate; print('matplotlib.pyplot' in sys.modules)"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "False"
