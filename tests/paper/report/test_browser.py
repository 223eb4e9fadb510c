"""The page in a browser: plots, legend, hover, zoom, filters, motion; without scripts, in the dark, and in a frame."""

from __future__ import annotations

import re
import shutil
from functools import partial
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED
from nearharmonic.plotting.profile import style_of
from nearharmonic_paper.report.page import filled, packed, page
from nearharmonic_paper.report.plots import document, gain
from nearharmonic_paper.report.shown import ShownFigure
from support.cubes import figure_cubes as made
from support.cubes.artists import luminance
from support.cubes.page_results import CLAIMS, DRAWN, PLOTS, write_claims, write_table
from support.projects.workflow_project import ROOT

pytestmark = pytest.mark.browser
ALL_FIGURES = [f"figure-{number}" for number in PLOTS]


def test_no_request_leaves_the_file_and_nothing_goes_wrong(opened, place):
    page = opened()
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    page.locator("button.method").first.click()
    page.wait_for_timeout(300)
    assert {url for url in page.heard["requests"] if not url.startswith("data:")} == {place.as_uri()}
    assert page.heard["errors"] == []


def test_first_picture_is_painted_within_half_a_second(browser, results, tmp_path):
    """The fastest of five loads: other processes share the processors. The page has pictures of the usual size."""
    copied = shutil.copytree(results, tmp_path / "tiny")
    for place in (copied / "figures").glob("*.svg"):
        shutil.copy(results / f"figures/{DRAWN}.svg", place)
    place = tmp_path / "report.html"
    place.write_text(page(folder=copied)["page"], encoding="utf-8")
    painted = """() => new Promise((done) => new PerformanceObserver((seen) => {
      const picture = seen.getEntries().find((one) => one.element?.tagName === "IMG");
      if (picture) done(picture.startTime);
    }).observe({ type: "largest-contentful-paint", buffered: true }))"""
    times = []
    for _ in range(5):
        with browser.new_context(viewport={"width": 1280, "height": 900}) as context:
            shown = context.new_page()
            shown.goto(place.as_uri())
            times.append(shown.evaluate(painted))
    assert min(times) < 500, times


def test_every_plot_is_drawn(wide):
    names = wide.evaluate("plots().map((plot) => plot.name)")
    assert set(names) == {f"figure-{n}-panel-{i}" for n in PLOTS for i in range(1, PLOTS[n] + 1)}
    for name in names:
        box = wide.locator(f"#{name} canvas").first.bounding_box()
        assert box["width"] > 300
        assert box["height"] > 200


def test_legend_shows_one_method_alone_and_others_beside_it(wide):
    seen = partial(wide.evaluate, "(id) => visibleIn(id)")
    before = {figure: seen(figure) for figure in ALL_FIGURES}
    legend = wide.locator("#figure-3 .legend")
    ruth, other, every = (legend.locator(one) for one in ("[data-method=ruth]", "[data-method=aba104]", ".all"))
    for button, visible, pressed in (
        (ruth, {"ruth"}, [False, True, False]),
        (other, {"ruth", "aba104"}, [False, True, True]),
        (ruth, {"aba104"}, [False, False, True]),
        (other, set(before["figure-3"]), [True, False, False]),
        (ruth, {"ruth"}, [False, True, False]),
        (every, set(before["figure-3"]), [True, False, False]),
    ):
        button.click()
        assert set(seen("figure-3")) == visible
        states = [one.get_attribute("aria-pressed") for one in (every, ruth, other)]
        assert states == [str(one).lower() for one in pressed]
        assert all(seen(figure) == before[figure] for figure in set(ALL_FIGURES) - {"figure-3"})


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The page of a figure of the gain alone, whose curves have labels near each other."""
    cube = made.crowded().assign_attrs(system_label="system")
    named = dict(zip(cube.integrator.values, cube.label.values, strict=True))
    figure = ShownFigure(anchor="figure-gain", title="", caption="", stem="", panels=gain(cube, cube), methods=named)
    figure.document = packed(document(figure.plots))
    page = tmp_path_factory.mktemp("alone") / "figure-gain.html"
    page.write_text(filled("figure.html", {"results": SimpleNamespace(folder=page.parent), "figure": figure}))
    return page


@pytest.mark.parametrize("figure", ["figure-3", "figure-gain"])
def test_hover_on_legend_fades_other_methods_and_their_labels(wide, opened, alone, figure):
    page = opened(at=alone) if figure == "figure-gain" else wide
    opacities = partial(page.evaluate, "(id) => opacitiesIn(id)", figure)
    before = opacities()
    page.locator(f".figure:has([id^={figure}-panel]) [data-method=ruth]").hover()
    pointed = opacities()
    assert pointed["ruth"] == before["ruth"]
    assert all(max(pointed[one]) <= 0.12 < max(before[one]) for one in before.keys() - {"ruth"})
    page.mouse.move(2, 2)
    assert opacities() == before


#: Left edge and height of each label of a curve, in pixels from the lower left corner of the frame; widths of labels of
#: levels; and the width of the frame.
LABELS = """(name) => {
  const plot = plotOf(name), ink = document.createElement("canvas").getContext("2d");
  const broad = (text, size) => Object.assign(ink, { font: `${size}px system-ui, sans-serif` }).measureText(text).width;
  const [left, bottom] = spotOf(name, plot.x_range.start, plot.y_range.start);
  const ends = plot.renderers.filter((one) => one.glyph.type === "Text").map(({ data_source: { data } }) => {
    const [x, y] = spotOf(name, data.aside[0], data.row[0]);
    return [x - 2 - broad(data.label[0], 11) - left, bottom - y];
  });
  const levels = plot.center.filter((one) => one.type === "Label").flatMap((one) => one.text.split("\\n"));
  return [ends, levels.map((line) => broad(line, 12) + 8), viewOf(name).frame.bbox.width];
}"""


@pytest.mark.parametrize("width", [360, 390, 1280])
def test_labels_have_space_on_phone_and_desk(opened, alone, width):
    ends, _, _ = opened(at=alone, viewport={"width": width, "height": 900}).evaluate(LABELS, "figure-gain-panel-2")
    lefts, heights = np.transpose(ends)
    assert (len(ends), min(lefts) > 0) == (len(BENCHMARKED), True)
    assert min(np.diff([-5.5, *sorted(heights)])) >= 11
    _, levels, frame = opened(viewport={"width": width, "height": 900}).evaluate(LABELS, "figure-4-panel-1")
    assert 50 < max(levels) < frame


def lonely(x, y):
    """Index (method, point) of the point that is farthest from all others, by logarithms over the ranges of both."""
    there = np.argwhere(np.isfinite(y) & (y > 0))
    places = np.array([[np.log(x[j]), np.log(y[i, j])] for i, j in there])
    places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
    gaps = np.linalg.norm(places[:, None] - places[None], axis=-1) + 9 * np.eye(len(places))
    inner = (places > 0.1).all(axis=1) & (places < 0.9).all(axis=1)
    return tuple(there[np.argmax(np.where(inner, gaps.min(axis=1), 0))])


@pytest.mark.parametrize(
    ("panel", "system", "variable", "unit"),
    [
        ("figure-3-panel-1", "henon_heiles", "max_energy_error", ""),
        ("figure-5-panel-2", "kepler", "mean_energy_error", " h"),
    ],
)
def test_a_hover_shows_the_numbers_that_stand_in_the_cube(wide, results, panel, system, variable, unit):
    with h5py.File(results / "cubes" / f"{system}.h5") as cube:
        x, y = cube["tau_per_stage"][()], cube[variable][()]
        i, j = lonely(x, y)
        method, evaluations = cube["label"][i].decode(), cube["evaluations"][i, j]
    wide.locator(f"#{panel}").scroll_into_view_if_needed()
    left, top = wide.evaluate("([id, x, y]) => spotOf(id, x, y)", [panel, float(x[j]), float(y[i, j])])
    wide.mouse.move(left - 3, top)
    wide.mouse.move(left, top)
    tooltip = wide.locator(".bk-tooltip-content", has_text=method)
    tooltip.wait_for(timeout=3000)
    lines = tooltip.inner_text().splitlines()
    said = " ".join(" ".join(lines).split())
    assert len(lines) == 3
    assert lines[0].strip() == method
    assert f"{x[j]:.6g}{unit}" in said
    shown_error = float(re.search(r"\|ΔH/H₀\|: (\S+)", said)[1])
    assert shown_error == pytest.approx(y[i, j], rel=5.1e-5)  # five digits
    assert f"{evaluations:,}" in said
    wide.mouse.move(2, 2)


def ranges(page, panel):
    return page.evaluate("(id) => [plotOf(id).x_range, plotOf(id).y_range].map((one) => [one.start, one.end])", panel)


def test_rectangle_in_one_panel_zooms_all_panels_of_its_figure(wide):
    upper, lower, other = "figure-3-panel-1", "figure-3-panel-2", "figure-1-panel-1"
    before, apart = ranges(wide, upper), ranges(wide, other)
    assert ranges(wide, lower) == before
    wide.locator(f"#{upper}").scroll_into_view_if_needed()
    (x0, x1), (y0, y1) = before
    start = wide.evaluate("([id, x, y]) => spotOf(id, x, y)", [upper, x0 * (x1 / x0) ** 0.2, y0 * (y1 / y0) ** 0.2])
    end = wide.evaluate("([id, x, y]) => spotOf(id, x, y)", [upper, x0 * (x1 / x0) ** 0.6, y0 * (y1 / y0) ** 0.7])
    wide.mouse.move(*start)
    wide.mouse.down()
    wide.mouse.move(*end, steps=4)
    wide.mouse.up()
    wide.settle()
    after = ranges(wide, upper)
    for (low, high), (first, last), (a, b) in zip(after, before, [(0.2, 0.6), (0.2, 0.7)], strict=True):
        np.testing.assert_allclose(np.log([low / first, high / first]) / np.log(last / first), [a, b], atol=0.02)
    assert ranges(wide, lower) == after
    assert ranges(wide, other) == apart
    wide.locator("#figure-3 button[data-zoom=reset]").click()
    np.testing.assert_allclose(ranges(wide, lower), before)


def test_verdict_filter_shows_claims_and_link_restores_hidden_one(wide):
    rows = wide.locator("#statements .claims tbody tr")
    wide.locator("#statements").evaluate("(one) => { one.open = true; }")
    wide.locator("button[data-only=holds]").click()
    assert [row.get_attribute("id") for row in rows.all() if row.is_visible()] == ["claim-one", "claim-five"]
    pressed = wide.locator("button[data-only][aria-pressed=true]")
    assert pressed.all_inner_texts() == ["2 hold"]
    wide.locator(".tile.fails a").click()
    rows.nth(2).wait_for()
    assert all(row.is_visible() for row in rows.all())
    assert pressed.all_inner_texts() == [f"all {len(CLAIMS) - 1}"]


def test_a_made_small_picture_looks_like_the_file(wide, results):
    """By pixels; a shift of a hundredth of a point changes one by the share of one row of samples at most, 64."""
    different = """async (sources) => {
      const pixels = async (source) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = Object.assign(document.createElement("canvas"), { width: 1008, height: 922 });
        canvas.getContext("2d").drawImage(image, 0, 0, 1008, 922);
        return canvas.getContext("2d").getImageData(0, 0, 1008, 922).data;
      };
      const [one, other] = [await pixels(sources[0]), await pixels(sources[1])];
      const dark = one.filter((value) => value < 128).length / one.length;
      return [dark, one.filter((value, i) => Math.abs(value - other[i]) > 100).length / one.length];
    }"""
    original = (results / f"figures/{DRAWN}.svg").read_text(encoding="utf-8")
    small = wide.locator("#figure-4 img").get_attribute("src")
    assert len(small) < 0.75 * len(original)
    whole = wide.evaluate("(text) => 'data:image/svg+xml,' + encodeURIComponent(text)", original)
    dark, share = wide.evaluate(different, [whole, small])
    assert dark > 0.001
    assert share < 1e-5


STARTS = {"sho": ([1.0], [0.0]), "henon_heiles": ([0.3, 0.0], [0.0, 0.4])}


@pytest.mark.parametrize("system", STARTS)
@pytest.mark.parametrize("method", ["ruth", "babs7o7h"])
def test_figure_in_motion_takes_the_steps_of_integrate(wide, system, method):
    """200 steps of at most 14 moves of two roundings, whose errors grow with the time on regular orbits."""
    q, p = STARTS[system]
    found = wide.evaluate("(given) => alive.run(...given)", [system, method, 0.5, q, p, 200])
    run = nh.integrate(system, method, 0.5, t_end=100, q0=q, p0=p, summation="plain")
    assert found["q"] == pytest.approx(run.q.values[-1].tolist(), abs=1e-12)
    assert found["p"] == pytest.approx(run.p.values[-1].tolist(), abs=1e-12)
    assert found["worst"] == pytest.approx(run.max_energy_error.item(), rel=1e-4, abs=1e-14)


#: Pixels of a colour in the panel of energy errors.
COLOURED = """(colour) => {
  const canvas = document.querySelector("#alive .errors canvas"), [red, green, blue] = colour;
  const seen = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < seen.length; i += 4) count += seen[i] === red && seen[i + 1] === green && seen[i + 2] === blue;
  return count;
}"""


def at_rest(page, system):
    """The figure in motion at the start of a system, and its clicks on Step."""
    section = page.locator("#alive")
    section.locator("details").evaluate("(one) => { one.open = true; }")
    section.locator("[name=system]").select_option(system)
    section.locator("[name=step]").click()  # the figure stops
    section.locator("[name=reset]").click()
    return section, section.locator("[name=step]").click


def told(section):
    return section.locator(".plane .note").all_inner_texts()


@pytest.mark.parametrize(("system", "q", "p"), [("sho", [0], [1]), ("henon_heiles", [0, 0.4], [0, 0.4])])
def test_shown_step_is_taken_and_its_error_is_drawn(wide, system, q, p):
    section, step = at_rest(wide, system)
    methods, tau = ("yoshida_s7o6a", "babs7o7h"), float(section.locator(".tau").inner_text())
    colours = [[round(255 * x) for x in to_rgb(style_of(method).colour)] for method in methods]
    assert [wide.evaluate(COLOURED, colour) for colour in colours] == [0, 0]
    step()
    assert min(wide.evaluate(COLOURED, colour) for colour in colours) > 5
    for method, text in zip(methods, told(section), strict=True):
        error = nh.integrate(system, method, tau, t_end=tau, q0=q, p0=p).max_energy_error.item()
        mantissa, power = f"{error:.1e}".split("e")
        raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        assert text == f"|ΔH/H₀| = {mantissa} × 10{raised} after 1 iteration"


def test_panel_c_is_seen_to_leave_its_energy_surface(wide):
    """At iteration 52, as the paper's panel (C) with this method, step and start does; the orbit of panel (D) stays."""
    section, step = at_rest(wide, "henon_heiles")
    for _ in range(53):
        step()
    left, right = told(section)
    assert left == "left its energy surface at iteration 52"
    assert right.endswith("after 53 iterations")
    section.locator("canvas").first.dblclick(position={"x": 200, "y": 150})
    step()
    assert all(text.endswith("after 1 iteration") for text in told(section)[:1])


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_figure_moves_by_itself_only_when_seen_and_wanted(opened, motion):
    page = opened(reduced_motion=motion)
    section = page.locator("#alive")
    before = told(section)
    page.wait_for_timeout(2500)  # the first iteration takes a second
    assert told(section) == before
    section.locator(".panels").evaluate("(one) => one.scrollIntoView()")
    if motion == "no-preference":
        section.locator(".plane .note", has_text="iteration").first.wait_for(timeout=20_000)
        section.locator("[name=run]").click()
        before = told(section)
    page.wait_for_timeout(2500)
    assert told(section) == before


def test_a_tap_on_a_phone_shows_a_value(opened, results):
    page = opened(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True, reduced_motion="reduce")
    with h5py.File(results / "cubes/kepler.h5") as cube:
        x, y = cube["tau_per_stage"][()], cube["max_energy_error"][()]
    i, j = lonely(x, y)
    page.locator("#figure-5-panel-1").scroll_into_view_if_needed()
    page.touchscreen.tap(*page.evaluate("(at) => spotOf(...at)", ["figure-5-panel-1", float(x[j]), float(y[i, j])]))
    shown = page.locator(".bk-Tooltip")
    shown.first.wait_for(timeout=3000)
    box = shown.first.bounding_box()
    assert 0 <= box["x"] < box["x"] + box["width"] <= 390
    page.evaluate("scrollBy(0, 50)")
    shown.first.wait_for(state="detached", timeout=3000)
    section = page.locator("#alive")
    section.locator(".panels").scroll_into_view_if_needed()
    canvas = section.locator("canvas").first
    box = canvas.bounding_box()
    assert box["width"] > 120
    canvas.tap(position={"x": box["width"] * 0.66, "y": box["height"] * 0.27})
    said = section.locator(".value").inner_text()
    assert re.match(r"Yosh s7o6 A, .+: q = \S+, p = \S+, H = \S+, \|ΔH/H₀\| = ", said)
    section.locator(".errors canvas").tap()
    assert section.locator(".value").inner_text() != said


# --- Other ways to read the page: by keyboard, in a narrow window, in dark mode, on paper, or without scripts.


def test_tab_reaches_legend_and_space_toggles_it_with_visible_focus(opened):
    page = opened()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    for _ in range(60):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.matches('button.method')"):
            break
    focused = page.locator("button.method").first
    assert page.evaluate("document.activeElement.dataset.method") == focused.get_attribute("data-method") == "ruth"
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    page.keyboard.press("Space")
    assert focused.get_attribute("aria-pressed") == "true"
    assert page.evaluate("visibleIn('figure-gain')") == ["ruth"]


def test_page_fits_every_width(wide):
    """No sideways scrolling, and a column of text of 45 characters, or as wide as a narrow window."""
    wide.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")
    for width in (360, 390, 768, 834, 1024, 1280, 1366, 1440, 1920):
        wide.set_viewport_size({"width": width, "height": 900})
        wide.settle()
        assert wide.evaluate("document.documentElement.scrollWidth") == width
        for column in (".lead", ".condition", "main > section > p", "figcaption"):
            room, letter = wide.evaluate("(selector) => roomFor(selector)", column)
            assert room >= min(45 * letter, 0.9 * width), (width, column)
    wide.set_viewport_size({"width": 1280, "height": 900})
    wide.screenshot(full_page=True)  # a tall window once made the plot of errors grow without end
    wide.wait_for_timeout(500)
    assert wide.locator("#alive .errors").bounding_box()["height"] < 600
    wide.evaluate("for (const one of document.querySelectorAll('details')) one.open = false")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast_of_four_and_half(opened, scheme):
    """Relative luminance of WCAG 2. What is drawn for white paper is inverted in the dark and has its own colours."""
    page = opened(color_scheme=scheme)
    page.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")

    def light(colour):
        return luminance([int(part) / 255 for part in re.findall(r"\d+", colour)[:3]])

    found = page.evaluate("coloursOfText()")
    assert len(found) > 10
    assert (light(page.evaluate("getComputedStyle(document.body).backgroundColor")) < 0.1) == (scheme == "dark")
    for ink, paper, text in found:
        low, high = sorted((light(ink), light(paper)))
        assert (high + 0.05) / (low + 0.05) >= 4.5, text


def test_pictures_stay_until_plots_are_drawn_in_their_place(opened):
    page = opened(
        early="""() => document.addEventListener("DOMContentLoaded", () => {
      window.early = document.documentElement.scrollHeight;
      window.covered = [...document.querySelectorAll(".live img.static")].map((one) => one.checkVisibility());
      window.shift = 0;
      new PerformanceObserver((seen) => { for (const one of seen.getEntries()) shift += one.value; })
        .observe({ type: "layout-shift", buffered: true });
    })"""
    )
    assert page.evaluate("covered") == [True] * len(PLOTS)
    assert not any(shown(page, ".live img.static"))
    assert abs(page.evaluate("document.documentElement.scrollHeight - early")) < 50
    assert page.evaluate("shift") < 0.01


def test_page_of_usual_size_is_printed_on_twelve_sheets(browser, results, tmp_path):
    copied = shutil.copytree(results, tmp_path / "tiny")
    for place in (copied / "figures").glob("*.svg"):
        shutil.copy(results / f"figures/{DRAWN}.svg", place)
    value = "0 of 102 step sizes; Ruth's error over that of the worst new method 2.8 to 19, over the best up to 66"
    write_claims(copied, [(f"{one}{i}", *rest[:3], value, rest[-1]) for i in range(15) for one, *rest in CLAIMS])
    write_table(copied, "table4_coefficients", [["set", "printed"], *([str(i), "0." + "7" * 76] for i in range(54))])
    write_table(copied, "integrators", [["stages of method"] * 17, *(["babs7o7h", *["7"] * 16] for _ in range(82))])
    place = tmp_path / "report.html"
    place.write_text(page(folder=copied)["page"], encoding="utf-8")
    with browser.new_context() as context:
        printed = context.new_page()
        printed.goto(place.as_uri())
        printed.wait_for_selector("html[data-ready]", state="attached")
        sheets = len(re.findall(rb"/Type\s*/Page\b", printed.pdf(format="A4")))
        assert 4 < sheets <= 12
        printed.set_viewport_size({"width": 703, "height": 1000})  # of A4 between its margins
        printed.emulate_media(media="print")
        assert printed.evaluate("document.documentElement.scrollWidth") == 703
        assert printed.locator("#table-4 td").last.is_visible()


def shown(page, selector):
    return [one.is_visible() for one in page.locator(selector).all()]


def test_the_static_pictures_stand_in_where_scripts_are_off(opened):
    page = opened(java_script_enabled=False)
    assert shown(page, ".figure.live img.static") == [True] * len(PLOTS)
    assert not any(shown(page, ".panels"))
    assert not any(shown(page, "button"))
    drawn = page.locator("#figure-4 img")
    assert drawn.bounding_box()["width"] > 300


def test_the_static_pictures_are_printed_and_the_plots_are_not(wide):
    assert not any(shown(wide, ".figure.live img.static"))
    assert all(shown(wide, ".panels"))
    wide.emulate_media(media="print")
    assert all(shown(wide, ".figure.live img.static"))
    assert not any(shown(wide, ".panels"))
    wide.emulate_media(media="screen")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_plots_and_pictures_are_dark_in_the_dark(opened, scheme):
    import io

    from PIL import Image

    page = opened(color_scheme=scheme)
    for selector in ("#figure-3-panel-1", ".hero img"):
        with Image.open(io.BytesIO(page.locator(selector).first.screenshot())) as shot:
            pixels = np.asarray(shot.convert("L"))
        assert (np.median(pixels) < 60) == (scheme == "dark")


# --- docs/how_to/figure_in_a_page.md: the names of figures, and a page with its iframe in chromium.

TEXT = (ROOT / "docs/how_to/figure_in_a_page.md").read_text(encoding="utf-8")
(HTML,) = re.findall(r"```html\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.fixture
def embedded(results, tmp_path):
    """A page with two frames of the page of how to, beside one file."""
    (tmp_path / "figure-3.html").write_text(page(folder=results)["figure_3"], encoding="utf-8")
    outer = tmp_path / "mine.html"
    head = '<!doctype html><html lang="en" data-ready><title>mine</title><h1>Mine</h1>'  # as a page of results says
    outer.write_text(f"{head}{HTML}{HTML}", encoding="utf-8")
    return outer


def test_figure_is_drawn_in_a_sandboxed_frame_without_requests(opened, embedded):
    shown = opened(at=embedded, viewport={"width": 1280, "height": 2400})
    first, second = shown.frames[1:]
    for frame in (first, second):
        frame.wait_for_selector("html[data-ready]", state="attached")
        names = frame.evaluate("Bokeh.documents[0].roots().map((plot) => plot.name)")
        assert len(names) == PLOTS["3"]
        for name in names:
            assert frame.locator(f"#{name} canvas").first.bounding_box()["width"] > 300
    visible = "Bokeh.documents[0].roots()[0].renderers.filter((one) => one.visible).length"
    before = second.evaluate(visible)
    first.locator("button.method").first.click()
    assert first.evaluate(visible) < before == second.evaluate(visible)
    own = {embedded.as_uri(), embedded.with_name("figure-3.html").as_uri()}
    assert {url for url in shown.heard["requests"] if not url.startswith("data:")} == own
    assert shown.heard["errors"] == []
    with pytest.raises(Exception, match=r"cross-origin|Blocked|SecurityError"):
        first.evaluate("parent.document.title")
