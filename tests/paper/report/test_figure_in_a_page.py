"""docs/how_to/figure_in_a_page.md: the names of figures, and a page with its iframe in chromium."""

from __future__ import annotations

import re

import pytest

from nearharmonic_paper.report.page import page
from support.cubes.page_results import PLOTS
from support.projects.workflow_project import ROOT

TEXT = (ROOT / "docs/how_to/figure_in_a_page.md").read_text(encoding="utf-8")
(HTML,) = re.findall(r"```html\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.fixture
def embedded(results, tmp_path):
    """A page with two frames of the page of how to, beside one file."""
    (tmp_path / "figure-3.html").write_text(page(folder=results)["figure_3"], encoding="utf-8")
    outer = tmp_path / "mine.html"
    outer.write_text(f'<!doctype html><html lang="en"><title>mine</title><h1>Mine</h1>{HTML}{HTML}', encoding="utf-8")
    return outer


@pytest.mark.browser
def test_figure_is_drawn_in_a_sandboxed_frame_without_requests(browser, embedded):
    context = browser.new_context(viewport={"width": 1280, "height": 2400})
    shown = context.new_page()
    requests, errors = [], []
    shown.on("request", lambda request: requests.append(request.url))
    shown.on("pageerror", lambda error: errors.append(str(error)))
    shown.on("console", lambda said: said.type in {"error", "warning"} and errors.append(said.text))
    shown.goto(embedded.as_uri())
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
    assert {url for url in requests if not url.startswith("data:")} == own
    assert errors == []
    with pytest.raises(Exception, match=r"cross-origin|Blocked|SecurityError"):
        first.evaluate("parent.document.title")
    context.close()
