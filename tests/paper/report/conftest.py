"""One page for all tests of the page, made from small results, and a browser that opens it."""

from __future__ import annotations

import shutil

import pytest

from nearharmonic_paper.report.page import page
from support.cubes.page_results import write_results


@pytest.fixture(scope="session", autouse=True)
def _outside_a_run():
    """The tests themselves may run in a job of a workflow."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("NEARHARMONIC_RUN", raising=False)
        yield


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


FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
#: Two frames later what was changed is drawn. Without a display, chromium may skip frames.
DRAWN = "() => new Promise((go) => (requestAnimationFrame(() => requestAnimationFrame(go)), setTimeout(go, 2000)))"

#: Functions that the tests call in the page.
HELPERS = """() => {
window.plots = () => Bokeh.documents.flatMap((one) => one.roots());
window.plotOf = (id) => plots().find((plot) => plot.name === id);
window.viewOf = (id) => Bokeh.index.get_one(plotOf(id));
const drawn = (figure) => plots().filter((plot) => plot.name.startsWith(`${figure}-panel`))
  .flatMap((plot) => plot.renderers).filter((one) => one.tags.length);
window.visibleIn = (figure) => [...new Set(drawn(figure).filter((one) => one.visible).map((one) => one.tags[0]))];
window.opacitiesIn = (figure) => {
  const found = {};
  for (const { tags: [method], glyph } of drawn(figure))
    for (const alpha of [glyph.line_alpha, glyph.text_alpha])
      if (alpha !== undefined) (found[method] ??= []).push(alpha.field ? 1 : alpha.value ?? alpha);
  return found;
};
window.roomFor = (selector) => {
  const place = document.querySelector(selector);
  const words = Object.assign(document.createElement("span"), { textContent: place.textContent.replace(/\\s+/g, " ") });
  words.style.cssText = "white-space: nowrap; position: absolute";
  place.append(words);
  const letter = words.getBoundingClientRect().width / words.textContent.length;
  words.remove();
  return [place.getBoundingClientRect().width, letter];
};
window.coloursOfText = () => {
  const found = new Map();
  for (const one of document.querySelectorAll("body *")) {
    const said = [...one.childNodes].filter((node) => node.nodeType === 3).map((node) => node.data).join("").trim();
    if (!said || one.closest("script, .panel, .method, svg") || !one.checkVisibility()) continue;
    const clear = (place) => getComputedStyle(place).backgroundColor === "rgba(0, 0, 0, 0)";
    let paper = one;
    while (paper !== document.body && clear(paper)) paper = paper.parentElement;
    const colours = [getComputedStyle(one).color, getComputedStyle(paper).backgroundColor];
    found.set(colours.join(), [...colours, said.slice(0, 40)]);
  }
  return [...found.values()];
};
window.spotOf = (id, x, y) => {
  const plot = plotOf(id), view = viewOf(id);
  const box = document.getElementById(id).getBoundingClientRect(), frame = view.frame.bbox;
  const share = (range, value, log) => log
    ? Math.log(value / range.start) / Math.log(range.end / range.start)
    : (value - range.start) / (range.end - range.start);
  const [along, up] = [share(plot.x_range, x, true), share(plot.y_range, y, true)];
  return [box.left + frame.left + along * frame.width, box.top + frame.top + (1 - up) * frame.height];
};
}"""


@pytest.fixture(scope="session")
def chromium():
    """Path of the browser; tests without one are skipped before a page is made for them."""
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    return shutil.which("chromium") or shutil.which("chromium-browser") or pytest.skip("chromium is not installed")


@pytest.fixture(scope="module")
def browser(chromium):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield started
        started.close()


@pytest.fixture(scope="module")
def opened(chromium, browser, place):
    """Open the page as a function of the browser's settings; what went wrong is in ``page.heard``."""
    contexts = []

    def open_page(early="", at=place, **settings):
        context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | settings))
        contexts.append(context)
        page = context.new_page()
        page.add_init_script(early and f"({early})()")
        page.heard = {"requests": [], "errors": []}
        page.on("request", lambda request: page.heard["requests"].append(request.url))
        page.on("console", lambda said: said.type in {"error", "warning"} and page.heard["errors"].append(said.text))
        page.on("pageerror", lambda error: page.heard["errors"].append(str(error)))
        page.settle = lambda: page.evaluate(DRAWN)
        page.goto(at.as_uri())
        if settings.get("java_script_enabled", True):
            page.wait_for_selector("html[data-ready]", state="attached")
            page.evaluate(HELPERS)
        return page

    yield open_page
    for context in contexts:
        context.close()


@pytest.fixture(scope="module")
def wide(opened):
    """The page in a wide window, shared: a test leaves it as it was."""
    return opened()
