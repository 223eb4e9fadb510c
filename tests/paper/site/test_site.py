"""The site: it builds without a warning, its links lead somewhere, it asks for nothing from outside."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("sphinx", reason="the site needs the extra [docs]")


pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
#: What a browser loads by itself, by element and attribute.
LOADED = {("script", "src"), ("link", "href"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("object", "data")}


@pytest.fixture(scope="module")
def site():
    """The site, by the command that CONTRIBUTING.md prints; a build that is up to date is checked again in seconds."""
    place = ROOT / "build/site"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-j", "auto", "docs", str(place)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return place


class Page(HTMLParser):
    """Ids of a page, targets of its links, and files that it loads."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loaded = set(), set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("id", "name") and value:
                self.ids.add(value)
            if (tag, name) in LOADED:
                self.loaded.add(value)
            elif tag == "a" and name == "href":
                self.links.add(value)


@cache
def read(path):
    return Page(path.read_text(encoding="utf-8"))


def pages(site):
    return [path for path in site.rglob("*.html") if "_static" not in path.parts]


def test_a_page_stands_for_each_source(site):
    """Parts are included by pages."""
    files = (path.relative_to(ROOT / "docs") for path in ROOT.glob("docs/**/*.md"))
    sources = {path.with_suffix(".html") for path in files if path.parent.name != "parts"}
    assert len(sources) > 80
    assert sources <= {path.relative_to(site) for path in pages(site)}


def test_no_page_loads_anything_from_outside(site):
    outside = {(path.name, url) for path in pages(site) for url in read(path).loaded if urlsplit(url).netloc}
    assert outside == set()


def test_links_between_pages_lead_to_files_and_headings(site):
    lost = set()
    for path in pages(site):
        for url in read(path).links | read(path).loaded:
            parts = urlsplit(url)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = target.is_file() and (
                not parts.fragment or target.suffix != ".html" or unquote(parts.fragment) in read(target).ids
            )
            if not there:
                lost.add((str(path.relative_to(site)), url))
    assert lost == set()


def test_the_quickstart_ran_and_is_a_notebook_to_download(site):
    """Two of its cells draw, and no cell failed: a build stops at an exception."""
    (path,) = site.glob("_downloads/*/quickstart.ipynb")
    cells = [one for one in json.loads(path.read_text(encoding="utf-8"))["cells"] if one["cell_type"] == "code"]
    source = (ROOT / "docs/start/quickstart.md").read_text(encoding="utf-8")
    assert cells
    assert all("".join(one["source"]) in source for one in cells)
    shown = (site / "start/quickstart.html").read_text(encoding="utf-8")
    assert len(re.findall(r'<img [^>]*src="\.\./_images/\w+\.png"', shown)) == 2


@pytest.fixture(scope="module")
def browser(site):
    """A function that opens a page of the site, and notes its requests and errors."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    import shutil

    program = shutil.which("chromium")
    if program is None:
        pytest.skip("no chromium")
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=program, args=["--headless", "--no-sandbox", "--disable-gpu"]
        )

        def opened(name, width=1200, **settings):
            page = running.new_page(viewport={"width": width, "height": 900}, **settings)
            page.heard = []
            page.on("request", lambda one: page.heard.append(one.url))
            page.on("pageerror", lambda one: page.heard.append(f"error: {one}"))
            page.goto((site / name).as_uri(), wait_until="load")
            return page

        yield opened
        running.close()


def test_a_browser_loads_formulas_and_nothing_from_outside(browser):
    page = browser("start/near_harmonic.html")
    page.wait_for_selector("mjx-container", timeout=20_000)
    assert [url for url in page.heard if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.parametrize("name", ["results/figure_6", "start/near_harmonic"])
def test_figure_6_moves_by_itself_where_it_is_seen(browser, name):
    page = browser(f"{name}.html")
    page.locator("iframe.alive").evaluate("(one) => one.scrollIntoView()")
    frame = page.frame_locator("iframe.alive")
    frame.locator(".plane .note", has_text="iteration").first.wait_for(timeout=20_000)


@pytest.mark.parametrize("width", [390, 1280, 1313, 1366, 1439, 1440])
def test_each_page_and_its_contents_fit_the_window(browser, width):
    page = browser("start/choosing.html", width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    drawer = page.locator("aside.toc-drawer").bounding_box()
    hidden = page.evaluate("getComputedStyle(document.querySelector('aside.toc-drawer')).position") == "fixed"
    assert hidden == (width < 1313)
    assert hidden or drawer["x"] + drawer["width"] <= width


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("name", ["index", "start/quickstart"], ids=["figure", "notebook"])
def test_backgrounds_of_pictures_are_the_colour_of_the_page(browser, name, theme):
    """The theme of the site decides, and not the scheme of the system: the button at the top chooses it."""
    page = browser(f"{name}.html", color_scheme="light" if theme == "dark" else "dark")
    page.evaluate(f"document.body.dataset.theme = '{theme}'")
    paper = [int(part) for part in re.findall(r"\d+", page.evaluate("getComputedStyle(document.body).backgroundColor"))]
    shot = np.asarray(Image.open(BytesIO(page.locator("article img").first.screenshot())).convert("RGB"))
    assert shot[2, 2] == pytest.approx(paper, abs=1)
    assert abs(shot.mean(axis=2) - np.mean(paper)).max() > 200  # ink on it
