"""Words, markers and links of the page, each alone."""

from __future__ import annotations

import shutil

import pytest

from nearharmonic.integrators import integrators
from nearharmonic.plotting.profile import style_of
from nearharmonic_paper.report import page as assets
from nearharmonic_paper.report import shown as wording
from nearharmonic_paper.report.plots import MARKERS, span
from nearharmonic_paper.report.shown import Places, ShownFigure, ShownTable


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("0.9128804378017515", "0.9129"), ("1.0250652582803407e-06", "1.025e-06"),
        ("-5.381790373413507e-06", "-5.382e-06"),
        *((same, same) for same in ("0.02", "20000", "123456789", "0." + "3" * 76, "ABAs5o6H", "nan", "", "1e-76")),
    ],
)  # fmt: skip
def test_only_float_cells_are_shortened(written, shown):
    assert wording.cell(written) == shown


@pytest.mark.parametrize(
    ("verdicts", "planets", "said"),
    [
        (["holds", "holds but for edges", "holds", "erratum"], "fails",
         "Most of the paper holds; on planets the gain is a factor, not orders of magnitude"),
        (["holds", "holds"], "holds", "All of the paper holds"),
        (["fails", "fails"], None, "Nothing of the paper holds"),
        (["holds", "not decided here", "not decided here"], "not decided here", "All of what these runs decide holds"),
        (["holds", "fails", "fails"], "holds in part",
         "At most half of the paper holds; on planets the gain is orders of magnitude at some step sizes only"),
    ],
)  # fmt: skip
def test_headline_says_how_much_holds_and_gain_on_planets(verdicts, planets, said):
    found = [{"id": str(i), "kind": "result", "verdict": verdict} for i, verdict in enumerate(verdicts)]
    found.append({"id": "beside", "kind": "finding", "verdict": "fails"})
    if planets:
        found.append({"id": "outperform-ruth-kepler", "kind": "result", "verdict": planets})
    assert wording.headline(found) == said


def test_times_are_summed_in_minutes():
    assert wording.minutes(["50 s", "70 s", "3 min"]) == "5 minutes"
    assert wording.minutes(["20 s"]) == "1 minute"


def test_every_marker_of_method_has_shape_on_page():
    styles = {style_of(name) for name in integrators} | {style_of(f"a new method {i}") for i in range(200)}
    assert {style.marker for style in styles} == set(MARKERS)
    assert len({(marker.shape, marker.angle) for marker in MARKERS.values()}) == len(MARKERS)


def links(paper, needs=()):
    figures = [ShownFigure(anchor=f"figure-{n}", title="", caption="", stem="", cube="kepler") for n in (4, 5)]
    figures.append(ShownFigure(anchor="figure-limits", title="Limits", caption="", stem="", cube="linear"))
    table = ShownTable(anchor="table-4", caption="", header=(), rows=(), file="tables/table4_coefficients.csv")
    return Places(figures, [table]).pieces({"paper": {"section": paper}, "needs": list(needs)})


@pytest.mark.parametrize(
    ("paper", "needs", "pieces"),
    [
        ("Section 4", [], [("Section 4", "")]),
        ("Figure 4, caption", [], [("Figure 4", "figure-4"), (", caption", "")]),
        ("Figures 3, 4 and 5", [], [("Figures 3, ", ""), ("4", "figure-4"), (" and ", ""), ("5", "figure-5")]),
        ("Fig. 5 and Table 4", [], [("Fig. 5", "figure-5"), (" and ", ""), ("Table 4", "table-4")]),
        ("Figure 45", [], [("Figure 45", "")]),
        ("Eq. 4", ["tables/table4_coefficients.csv"], [("Eq. 4", ""), ("; shown in ", ""), ("Table 4", "table-4")]),
        (
            "Section 5",
            ["cubes/kepler.h5", "cubes/linear.h5"],
            [
                ("Section 5", ""), ("; shown in ", ""), ("Figure 4", "figure-4"), (", ", ""), ("Figure 5", "figure-5"),
                (", ", ""), ("Limits", "figure-limits"),
            ],
        ),
        ("Figure 4", ["cubes/linear.h5"], [("Figure 4", "figure-4")]),
    ],
)  # fmt: skip
def test_claim_place_links_to_named_item_or_its_files(paper, needs, pieces):
    assert links(paper, needs) == pieces


def test_axis_holds_all_numbers_except_those_it_cannot_show():
    one = span([[0.0, -1.0, float("nan"), 1e-9], [float("inf"), 1e-3]], logarithmic=True)
    assert one.start < 1e-9
    assert 1e-3 < one.end < 1
    assert span([[1e-9, 1e9]], logarithmic=True, highest=10).end == 10
    assert span([], logarithmic=True).start > 0
    flat = span([[3.0, 3.0]], logarithmic=False)
    assert flat.start < 3 < flat.end


@pytest.mark.parametrize("name", ["page.html", "figure.html", "parts.html", "page.css", "page.js", "alive.js"])
def test_an_edit_of_template_style_or_script_changes_the_digest(tmp_path, monkeypatch, name):
    before = assets.digest()
    for each in assets.FOLDER.iterdir():
        shutil.copy(each, tmp_path)
    monkeypatch.setattr(assets, "FOLDER", tmp_path)
    assert assets.digest() == before
    (tmp_path / name).write_text((tmp_path / name).read_text() + " ")
    assert assets.digest() != before
