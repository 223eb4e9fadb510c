"""Other ways to read the page: by keyboard, in a narrow window, in dark mode, on paper, or without scripts."""

from __future__ import annotations

import re

import numpy as np
import pytest

from support.cubes.page_results import PLOTS

pytestmark = pytest.mark.browser


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
    assert focused.get_attribute("aria-pressed") == "false"
    assert not any(any(visible) for _, visible in page.evaluate("drawnBy('ruth')"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_narrow_window_does_not_scroll_sideways(opened, scheme):
    page = opened(viewport={"width": 400, "height": 800}, color_scheme=scheme)
    for details in page.locator("details").all():
        details.evaluate("(one) => { one.open = true; }")
    page.settle()
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", paper))) < 200) == (scheme == "dark")


def shown(page, selector):
    return [one.is_visible() for one in page.locator(selector).all()]


def test_the_static_pictures_stand_in_where_scripts_are_off(opened):
    page = opened(java_script_enabled=False)
    assert shown(page, "section.figure img.static") == [True] * len(PLOTS)
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
