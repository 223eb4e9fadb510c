"""``nh.plot`` and ``nh.animate``: curves and films are the numbers of the Datasets, and everything else is refused."""

from __future__ import annotations

import dataclasses
import re
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import nearharmonic as nh
from nearharmonic.errors import FileWriteError, SettingError
from nearharmonic.plotting.drawing import POINTS, truncator, varying
from nearharmonic.plotting.plot import MEMBER
from support.cubes import figure_cubes as made
from support.cubes.artists import line_of, look_of
from support.cubes.page_reader import Reader
from support.methods.own_systems import spring

EXAMPLES = Path(__file__).parents[3] / "examples"
TAUS = [0.8, 0.1, 0.4, 0.2]


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_sweep_is_drawn_against_step_size_per_stage():
    curve = nh.sweep("sho", "ruth", TAUS, t_end=20)
    figure = nh.plot(curve)
    assert isinstance(figure, Figure)
    ascending = curve.sortby("tau")
    for axes, name in zip(figure.axes, ("max_energy_error", "mean_energy_error"), strict=True):
        line = line_of(axes, ascending.tau / 3, ascending[name])
        assert line.get_color() == look_of("ruth")[0]
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert legend(figure) == ["Ruth"]


def test_legend_and_lines_distinguish_several_sweeps():
    curves = [
        nh.sweep("sho", "ruth", TAUS, t_end=20),
        nh.sweep("sho", "ruth", TAUS, t_end=20, precision="extended"),
        nh.sweep("sho", "aba864", TAUS, t_end=20),
        nh.sweep("sho", EXAMPLES / "fourth_order.py", TAUS, t_end=20),
    ]
    figure = nh.plot(curves)
    assert legend(figure) == ["Ruth, double precision", "Ruth, extended precision", "ABA864", "five leapfrogs"]
    stages = (3, 3, 7, 5)
    lines = [
        line_of(figure.axes[0], np.sort(one.tau) / s, one.sortby("tau").max_energy_error)
        for one, s in zip(curves, stages, strict=True)
    ]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 4


def test_a_cube_is_drawn_as_its_figure():
    from nearharmonic.plotting.style import draw_profile

    cube = made.errors(["ruth", "babps9o7h"], precision=True)
    assert nh.plot(cube)._repr_png_() == draw_profile(cube)._repr_png_()


@pytest.mark.slow
@pytest.mark.parametrize(("system", "axes"), [("sho", ("q", "p")), ("kepler", ("q_1", "q_2"))])
def test_a_trajectory_is_drawn_over_time_and_as_an_orbit(system, axes):
    run = nh.integrate(system, "ruth", 0.25 if system == "sho" else 90.0, t_end=20 if system == "sho" else 8766)
    figure = nh.plot(run)
    upper, lower = figure.axes
    line_of(upper, run.t, abs(run.energy_error))
    curve = lower.lines[0]  # smooth, through every sample
    assert curve.get_xdata()[::POINTS].tolist() == run.q[:, 0].values.tolist()
    assert curve.get_ydata()[::POINTS].tolist() == (run.p[:, 0] if system == "sho" else run.q[:, 1]).values.tolist()
    assert all(name in label for name, label in zip(axes, (lower.get_xlabel(), lower.get_ylabel()), strict=True))
    assert upper.get_yscale() == "log"
    if system == "kepler":
        assert "$10^{6}$ km" in lower.get_xlabel()
    figure.draw_without_rendering()


def test_trajectories_of_one_method_are_told_apart_by_their_steps():
    runs = [nh.integrate("sho", "ruth", tau, t_end=20) for tau in (0.5, 0.25)]
    assert legend(nh.plot(runs)) == ["Ruth, τ = 0.5", "Ruth, τ = 0.25"]


@pytest.mark.parametrize(
    ("what", "says"),
    [
        (lambda: 3, "datasets = 'int' is not allowed: a Dataset of nearharmonic.integrate"),
        (list, "datasets = 'list' is not allowed"),
        (lambda: "ruth", "datasets = 'str' is not allowed"),
        (lambda: nh.sweep("sho", "ruth", TAUS, t_end=20).max_energy_error, "datasets = 'DataArray' is not allowed"),
        (lambda: [nh.integrate("sho", "ruth", 0.5, t_end=20), nh.sweep("sho", "ruth", TAUS, t_end=20)],
         "datasets = 'a trajectory and energy errors over tau' is not allowed"),
        (lambda: [nh.sweep("kepler", "ruth", [90.0], t_end=900), nh.sweep("sho", "ruth", TAUS, t_end=20)],
         "datasets = 'units of tau: 1, h' is not allowed: Datasets whose units are the same"),
        (lambda: [nh.integrate(s, "ruth", 0.5, t_end=20) for s in ("sho", "henon_heiles")],
         "datasets = 'systems of one and of several coordinates' is not allowed"),
        (lambda: [made.errors(["ruth"]), made.errors(["ruth"])], "datasets = 'a cube and a cube' is not allowed"),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_refused_in_one_sentence(what, says):
    with pytest.raises(SettingError, match=re.escape(says)):
        nh.plot(what())


@pytest.mark.slow
def test_the_axis_says_what_energy_errors_are_relative_to():
    # V = q^2/2 - 1/2 from q = 1 at rest: H0 = 0.
    zero = spring(V=lambda q: q[0] * q[0] / 2 - 0.5, units={"q": "m", "p": "m s-1", "t": "s", "energy": "m2 s-2"})
    labels = {
        r"$\max\,|\Delta H/H_0|$": spring(),
        r"$\max\,|\Delta H|$ (m2 s-2)": zero,
        r"$\max\,|\Delta H|$ relative to energy_scale 2, in m2 s-2": dataclasses.replace(zero, energy_scale="2"),
    }
    for label, system in labels.items():
        curve = nh.sweep(system, "ruth", [0.1, 0.2], t_end=5)
        assert nh.plot(curve).axes[0].get_ylabel() == label
        run = nh.integrate(system, "ruth", 0.1, t_end=5)
        assert nh.plot(run).axes[0].get_ylabel() == label.replace(r"\max\,", "")


def test_an_ensemble_is_drawn_against_the_one_parameter_that_varies():
    gm = np.linspace(1.5, 2.0, 7)
    many = nh.ensemble("kepler", "ruth", 200.0, parameters={"GM": gm}, t_end=8000)
    (axes,) = nh.plot(many).axes
    line_of(axes, gm, many.max_energy_error)
    assert axes.get_xlabel().startswith("GM")
    assert axes.get_yscale() == "log"


def test_ensemble_plot_shows_members_and_number_of_diverged_ones():
    starts = [(0.1, 0.0), (0.2, 0.0), (8.0, 8.0)]  # far outside of the well
    many = nh.ensemble("henon_heiles", "ruth", 0.5, q0=starts, p0=(0.0, 0.1), t_end=50)
    (axes,) = nh.plot(many).axes
    line_of(axes, [0, 1, 2], many.max_energy_error)
    assert "1 of 3 diverged" in axes.get_title(loc="left")


def test_errors_relative_to_different_energies_are_refused():
    for made_by, tau in ((nh.sweep, TAUS), (nh.integrate, 0.5)):
        given = [made_by("sho", "ruth", tau, t_end=20, energy_scale=scale) for scale in (None, 3)]
        with pytest.raises(SettingError, match="Datasets whose energy errors mean the same"):
            nh.plot(given)


def test_run_without_energies_plots_orbit_and_sweep_is_refused():
    (axes,) = nh.plot(nh.integrate("sho", "ruth", 0.5, t_end=20, energy="none")).axes
    assert axes.get_title(loc="left").endswith("phase space, from the dot on")
    with pytest.raises(SettingError, match="energy='none'"):
        nh.plot(nh.sweep("sho", "ruth", TAUS, t_end=20, energy="none"))


def test_a_figure_of_diverged_runs_alone_says_so():
    figure = nh.plot(nh.sweep("kepler", "babps9o7h", [21915.0, 43830.0]))
    for axes in figure.axes:
        assert any("every run diverged" in text.get_text() for text in axes.texts)
        assert axes.get_xlim()[0] > 1000  # as wide as the steps that were tried


def test_ensembles_are_drawn_against_their_only_common_varied_parameter():
    def ensemble(**values):
        return xr.Dataset({f"parameter_{name}": ("member", given) for name, given in values.items()})

    one, both = ensemble(a=[1.0, 2.0], b=[3.0, 3.0]), ensemble(a=[1.0, 2.0], b=[3.0, 4.0])
    assert varying([one]) == varying([one, one]) == "parameter_a"
    other = ensemble(a=[1.0, 1.0], b=[3.0, 4.0])
    for given in ([both], [one, both], [one, other], [ensemble(a=[1.0, 1.0])], [ensemble()]):
        assert varying(given) == MEMBER


def test_an_orbit_between_coarse_samples_is_the_exact_one():
    """A step of order four of 1/32 errs by its fifth power over 120."""
    run = nh.integrate("sho", "babps9o7h", 0.5, t_end=20)
    (curve, _) = nh.plot(run, kind="phase").axes[0].lines
    assert curve.get_xdata().size == 40 * POINTS + 1
    assert abs(np.hypot(curve.get_xdata(), curve.get_ydata()) - 1).max() < POINTS * (0.5 / POINTS) ** 5 / 120


@pytest.mark.parametrize(
    ("make", "tau"),
    [
        (lambda folder: dataclasses.replace(nh.systems["henon_heiles"], masses=("16", "16")), 2.0),
        (lambda folder: spring(), 0.5),
        (lambda folder: spring(name=str(folder / "evil.py")), 0.5),
    ],
    ids=["another of its name", "own", "named as a file"],
)
def test_coarse_orbits_of_systems_that_bear_a_name_are_points(tmp_path, make, tau):
    (tmp_path / "evil.py").write_text("raise SystemExit('it has run')\n")
    run = nh.integrate(make(tmp_path), "ruth", tau, t_end=40 * tau)
    line = nh.plot(run, kind="phase").axes[0].lines[0]
    assert (line.get_linestyle(), line.get_marker()) == ("None", ".")
    assert line.get_xdata().tolist() == run.q.values[:, 0].tolist()
    fine = nh.integrate(make(tmp_path), "ruth", 0.1, t_end=3)
    assert nh.plot(fine, kind="phase").axes[0].lines[0].get_linestyle() == "-"


@pytest.mark.slow
def test_a_tangent_result_shows_its_indicators_over_time():
    starts = {"q0": [[0, 0.1], [0, -0.15]], "p0": [[0.4, 0.1], [0.49, 0]]}
    for given in ({}, starts):
        found = nh.tangent("kepler" if not given else "henon_heiles", "ruth", 20 if not given else 0.1, samples=9,
                           t_end=2000 if not given else 20, **given)  # fmt: skip
        figure = nh.plot(found)
        names = ("lyapunov_exponent", "megno", "sali")
        for axes, name, says in zip(figure.axes, names, ("exponent", "MEGNO", "SALI"), strict=True):
            assert says in axes.get_ylabel()
            for row, line in zip(np.atleast_2d(found[name]), axes.lines, strict=True):
                np.testing.assert_array_equal(line.get_ydata(), row)
        assert ("(1/h)" in figure.axes[0].get_ylabel(), "(h)" in figure.axes[2].get_xlabel()) == (not given, not given)
        with pytest.raises(SettingError, match="kind = 'energy' is not allowed"):
            nh.plot(found, kind="energy")
    with pytest.raises(SettingError, match=r"^runs = "):
        nh.animate(found)


def test_observables_are_drawn_over_time():
    observed = {"E1": lambda q, p: q[0] ** 2}
    run = nh.integrate(spring(observables=observed), "ruth", 0.5, t_end=20)
    (axes,) = nh.plot(run, axes=("t", "E1")).axes
    line = line_of(axes, run.t, run.E1)
    assert (axes.get_xlabel(), axes.get_ylabel(), line.get_linestyle()) == ("time $t$", "E1", "-")


def test_a_method_of_a_registered_name_keeps_its_own_label():
    own = dataclasses.replace(nh.integrators["ruth"], label="mine")
    assert legend(nh.plot(nh.sweep("sho", own, [0.5, 0.625], t_end=5))) == ["mine"]


def test_methods_of_one_figure_have_colours_of_their_own():
    names = ("srkn_b11", "srkn_a14", "srkn_b6", "ruth", "leapfrog")
    curves = [nh.sweep("sho", name, [0.5, 0.625], t_end=5) for name in names]
    figure = nh.plot(curves)
    colours = [line.get_color() for line in figure.axes[0].lines[:5]]
    assert colours == [handle.get_color() for handle in figure.legends[0].legend_handles]
    assert len(set(colours)) == 5


@pytest.mark.filterwarnings("ignore:taus.* runs as")
def test_labels_of_short_axes_are_inside_of_the_figure():
    figure = nh.plot(nh.sweep("sho", "leapfrog", np.geomspace(0.3, 0.9, 12), t_end=20))
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert 0 <= axes.get_tightbbox().x0 < axes.get_tightbbox().x1 <= figure.bbox.width


def test_column_figure_has_legible_text_inside_its_85_mm():
    names = ["ruth", "yoshida_s7o6a", "abas5o6h", "babs7o7h", "babps9o7h"]
    runs = [nh.sweep("henon_heiles", name, [0.5, 0.1, 0.02], t_end=10) for name in names]
    figure = nh.plot(runs, width="column", title="A title")
    figure.draw_without_rendering()
    assert figure.get_figwidth() * 25.4 == pytest.approx(85)
    written = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in written) >= 6
    renderer = FigureCanvasAgg(figure).get_renderer()
    tops = [axes.get_tightbbox(renderer).y1 for axes in figure.axes]
    legend = figure.legends[0].get_window_extent(renderer)
    assert 0 <= legend.x0 < legend.x1 <= figure.bbox.width
    assert max(tops) < legend.y0
    assert all(axes.get_tightbbox(renderer).x0 >= 0 for axes in figure.axes)


def test_kind_axes_and_title_select_what_is_drawn():
    run = nh.integrate("henon_heiles", "ruth", 0.2, t_end=20, samples=200)
    (axes,) = nh.plot(run, kind="phase", axes=("q2", "p1"), title="Hénon-Heiles").axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$q_2$", "$p_1$")
    assert axes.lines[0].get_xdata()[::POINTS].tolist() == run.q[:, 1].values.tolist()
    assert axes.lines[0].get_ydata()[::POINTS].tolist() == run.p[:, 0].values.tolist()
    figure = nh.plot(run, kind="energy", title="Hénon-Heiles")
    (axes,) = figure.axes
    line_of(axes, run.t, abs(run.energy_error))
    assert [text.get_text() for text in figure.texts] == ["Hénon-Heiles"]
    curve = nh.sweep("sho", "ruth", TAUS, t_end=20).sortby("evaluations")
    (axes,) = nh.plot(curve, kind="work").axes
    line_of(axes, curve.evaluations, curve.max_energy_error)


@pytest.mark.slow
def test_a_section_is_drawn_with_points_of_each_member():
    starts = [[0, 0.1, 0.4, 0], [0, 0.2, 0.3, 0]]
    found = nh.section("henon_heiles", "babps9o7h", 0.5, surface=0, starts=starts, t_end=200)
    (axes,) = nh.plot(found).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$q_2$", "$p_2$")
    for member, line in enumerate(axes.lines):
        np.testing.assert_array_equal(line.get_xdata(), found.q[member, :, 1])
        np.testing.assert_array_equal(line.get_ydata(), found.p[member, :, 1])
    assert len({tuple(line.get_color()) for line in axes.lines}) == 2


def test_a_recommendation_is_drawn_against_evaluations_and_time():
    found = nh.recommend("sho", 1e-4, t_end=50, methods=["ruth", "babps8o7h", "aba864"])
    figure = nh.plot(found)
    for axes, x in zip(figure.axes, (found.evaluations.values, 1e3 * found.time.values), strict=True):
        points = [(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if len(line.get_xdata()) == 1]
        assert points == list(zip(x.tolist(), found.max_energy_error.values.tolist(), strict=True))
    assert legend(figure) == [f"{i}. {label}" for i, label in enumerate(found.label.values, start=1)]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"kind": "section"}, "kind = 'section' is not allowed: of a trajectory one of energy, orbit, phase"),
        ({"kind": ""}, "kind = '' is not allowed"),
        ({"kind": "energy", "axes": ("q1", "p1")}, "axes = ('q1', 'p1') is not allowed: two quantities of an orbit"),
        (
            {"kind": "phase", "axes": ("q1", "p3")},
            "axes = ('q1', 'p3') is not allowed: two of q1, q2, p1, p2, energy_error, t",
        ),
        ({"width": "wide"}, "width = 'wide' is not allowed: page or column"),
        ({"kind": "phase", "axes": "q1"}, "axes = 'q1' is not allowed: two of q1, q2, p1, p2, energy_error, t"),
    ],
)  # fmt: skip
def test_unknown_kinds_and_axes_are_refused_with_known_ones(more, says):
    run = nh.integrate("henon_heiles", "ruth", 0.5, t_end=5)
    with pytest.raises(SettingError, match=re.escape(says)):
        nh.plot(run, **more)


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
def test_html_page_holds_every_frame_and_asks_for_nothing(run, tmp_path):
    place = nh.animate(run, tmp_path / "orbit.html", frames=4, title="A & <B>")
    page = place.read_text(encoding="utf-8")
    assert len(set(frames_of(page))) == 4
    assert not {"src", "href", "srcset", "data", "action"} & {
        name for _, told, _ in Reader(page).elements for name in told
    }
    assert not re.search(r"https?:|url\(|@import|fetch\(|XMLHttp", page)
    assert "<title>A &amp; &lt;B&gt;</title>" in page


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
    assert (orbit.get_title(), energy.get_title()) == ("A", "B")


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

    monkeypatch.setattr(FigureCanvasAgg, "draw", fail)
    with pytest.raises(MemoryError):
        nh.animate(run, place, frames=2)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"orbit.gif": b"old"}
    monkeypatch.undo()
    with pytest.raises(FileWriteError):
        nh.animate(run, place / "below.html", frames=2)
