"""Contents of the page, read with an HTML parser."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import nearharmonic
from nearharmonic.errors import ResultFileError
from nearharmonic_paper.report import page as room
from nearharmonic_paper.report.page import page
from nearharmonic_paper.report.shown import ShownFigure, ShownResults, in_order
from nearharmonic_paper.tasks.experiment import beside_the_paper, figures_of
from support.cubes import page_results as made
from support.cubes.page_reader import Reader, documents
from support.cubes.page_results import CLAIMS, DRAWN, KINDS_OF_CLAIMS, PLOTS, SYSTEMS, cube, write_cube, write_table
from support.projects.targets import TARGETS

EXPERIMENTS = beside_the_paper()
TITLES = [one.title for one in EXPERIMENTS]


@pytest.fixture(scope="module")
def read(text):
    return Reader(text)


@pytest.mark.slow
def test_same_results_give_the_same_bytes_in_another_process(results, text):
    code = (
        "import sys; from nearharmonic_paper.report.page import page; "
        f"sys.stdout.write(page({str(results)!r})['page']); "
        "assert not {'matplotlib', 'bokeh'} & sys.modules.keys()"  # each takes as much time as half of the page
    )
    environment = {"PYTHONPATH": str(Path(nearharmonic.__file__).parents[1]), "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True)
    assert done.stdout.decode() == text


def test_every_claim_is_row_with_its_value_threshold_and_verdict(text):
    body = "".join(re.findall(r'<table class="claims">.*?<tbody>(.*?)</tbody>', text, re.DOTALL))
    rows = [" ".join(words.split()) for _, words in Reader(body).all("tr")]
    assert len(rows) == len(CLAIMS)
    for row, claim in zip(rows, CLAIMS, strict=True):
        assert all(part in row for part in claim)
        assert f"as the paper has it: {claim[0]}" in row
        assert KINDS_OF_CLAIMS.get(claim[0], "result") in row
        assert (f"Margin: margin of {claim[0]}." in row) == (claim[3] != "not decided here")


def test_every_count_on_page_is_of_statements_of_paper(copied):
    place = copied / "tables/claims.json"
    place.write_text(place.read_text().replace('"derived/none.toml"', '"derived/none.toml", "tables/structure.csv"'))
    place.write_text(place.read_text().replace('"cubes/sho.h5", ', ""))
    text = page(folder=copied)["page"]
    body = re.search(r'<table class="sums">(.*?)</table>', text, re.DOTALL)[1]
    kinds = [words for told, words in Reader(body).all("th") if told["scope"] == "row"]
    rows = [[words for _, words in Reader(row).all("td")] for row in re.findall(r"<tr>.*?</tr>", body)[1:]]
    assert dict(zip(kinds, rows, strict=True)) == {
        "results": ["5", "1", "1", "1", "1", "", "1"],
        "background": ["1", "1", "", "", "", "", ""],
        "misprints": ["1", "", "", "", "", "1", ""],
    }
    tiles = re.findall(r"<strong>(\d)</strong> ([a-z ]+)", text)
    assert tiles == [("2", "hold"), ("1", "holds but for edges"), ("1", "holds in part"), ("1", "fails"),
                     ("1", "erratum"), ("1", "not decided here")]  # fmt: skip
    filters = [words for told, words in Reader(text).all("button") if told.get("data-only")]
    assert filters == [" ".join(tile) for tile in tiles]
    opening, _ = re.findall(r'<p class="condition">(.*?)</p>', text, re.DOTALL)
    assert " ".join(opening.split()).startswith(
        "Verdicts on 7 statements of the paper; findings of this project are not counted. "
        "1 not decided: <code>snakemake -j2 stability</code>, 1 minute, with the same config."
    )
    assert "7 statements of the paper can be decided by numbers" in text
    assert "1 finding of this project, not in the paper and not counted" in text


def test_what_fails_in_substance_is_named_first(text):
    words = re.search(r'<ul class="failures">.*?</ul>', text, re.DOTALL)[0]
    assert '<a href="#claim-three">The method is stable</a>' in words


@pytest.mark.parametrize("stems", [("gain", "fig3_henon_heiles"), ("fig3_henon_heiles",)])
def test_gain_is_shown_first_where_it_is_drawn(copied, monkeypatch, stems):
    drawn = [ShownFigure(anchor=stem, title=stem, caption="", stem=stem, picture=stem) for stem in stems]
    drawn[-1].cube = "henon_heiles"
    monkeypatch.setattr(room, "interactive", lambda _: [*reversed(drawn)])
    monkeypatch.setattr(room, "_alone", lambda *_: {})
    opening = re.search(r'<a class="hero".*?</a>', page(folder=copied)["page"])[0]
    assert f'href="#{stems[0]}"' in opening


def test_claim_links_only_to_existing_figures_and_tables(text, read):
    body = re.search(r'<table class="claims">.*?</table>', text, re.DOTALL)[0]
    links = {told["href"]: words for told, words in Reader(body).all("a")}
    assert "Section 2 and Figure 9; shown in Figure 1" in " ".join(words for _, words in Reader(body).all("span"))
    tables = {"#table-3": "Table 3", "#table-4": "Table 4"}
    assert links == tables | {"#figure-1": "Figure 1", "#figure-3": "Figures 3", "#figure-5": "5"}
    anchors = {told["id"] for _, told, _ in read.elements if "id" in told}
    assert {told["href"][1:] for told, _ in read.all("a") if told["href"].startswith("#")} <= anchors


def test_ids_are_unique_headings_in_order_and_pictures_described(read):
    ids = [told["id"] for _, told, _ in read.elements if "id" in told]
    assert len(ids) == len(set(ids))
    assert all("alt" in told for _, told, _ in read.elements if "src" in told)
    assert len(read.all("main")) == len(read.all("h1")) == len(read.all("header")) == len(read.all("nav")) == 1


def test_nothing_is_loaded_from_elsewhere(read):
    loaded = {told[key] for tag, told, _ in read.elements for key in ("src", "href") if key in told and tag != "a"}
    assert {url.partition(":")[0] for url in loaded} == {"data"}
    elsewhere = {told["href"] for told, _ in read.all("a") if told["href"].startswith(("http", "//"))}
    assert elsewhere == {"https://arxiv.org/abs/1501.04345"}
    (policy,) = [told["content"] for _, told, _ in read.elements if told.get("http-equiv")]
    assert policy.startswith("default-src 'none';")


def test_text_of_results_is_no_markup(text):
    assert "&lt;b&gt;galaxy&lt;/b&gt; &amp; tests" in text
    assert "&lt;6&gt; &amp; steep" in text
    assert "<b>galaxy" not in text


@pytest.fixture
def copied(results, tmp_path):
    return Path(shutil.copytree(results, tmp_path / "tiny"))


@pytest.mark.slow
def test_the_sections_of_experiments_show_what_is_there(copied):
    names = sorted(set().union(*(TARGETS[one.target] for one in EXPERIMENTS)))
    for name in names:
        if name.endswith(".svg"):
            shutil.copy(copied / "figures/fig1_sho.svg", copied / name)
        elif name.endswith(".csv"):
            write_table(copied, Path(name).stem, [["a"], ["1"]], f"Text of {Path(name).stem}.\n")
    found = page(folder=copied)["page"]
    assert [words for _, words in Reader(found).all("h2") if words in TITLES] == TITLES
    ids = {told["id"] for _, told, _ in Reader(found).elements if "id" in told}
    assert ids >= {f"figure-{Path(name).stem}" for name in names if name.endswith(".svg")}
    tables = found[found.index("Tables and coefficients") : found.index("What was left out")]
    for name in (name for name in names if name.endswith(".csv")):
        said = f"Text of {Path(name).stem}."
        assert said in found
        assert said not in tables


@pytest.mark.slow
def test_digest_of_long_table_is_shown_in_its_place(copied):
    table = "| method | ms |\n|---|---:|\n| *peer* | 0.5 |\n"
    digest = f"# Planet: times\n\nMeasured.\n\n## maximum\n\n{table}\n## mean\n\n{table}"
    write_table(copied, "work_precision_kepler", [["raw"], ["1"]], digest)
    found = page(folder=copied)["page"]
    assert "Planet: times; maximum" in found
    assert '<td>peer</td><td class="n">0.5</td>' in found
    assert '<th scope="col">raw</th>' not in found


@pytest.mark.parametrize("content", [None, "[", "[{}]", '[{"verdict": "maybe"}]', "7"])
def test_damaged_claims_are_named_with_command_that_makes_them(copied, content):
    place = copied / "tables/claims.json"
    place.unlink() if content is None else place.write_text(content)
    with pytest.raises(ResultFileError, match=r"claims\.json .*Make it again: snakemake"):
        ShownResults(copied).claims  # noqa: B018


@pytest.mark.slow
def test_page_that_grows_too_large_loses_its_largest_optional_picture(copied, monkeypatch):
    for name in ("linear_stability", "rounding_growth"):
        shutil.copy(copied / "figures/fig1_sho.svg", copied / f"figures/{name}.svg")
    shutil.copy(copied / f"figures/{DRAWN}.svg", copied / "figures/kepler_stability.svg")
    whole = page(folder=copied)["page"]
    monkeypatch.setattr(room, "LARGEST", len(whole.encode()) - 1000)
    smaller = page(folder=copied)["page"]
    assert len(smaller.encode()) <= room.LARGEST
    left_out = re.findall(r'left out to keep this page small: <a href="(.*?)">', smaller)
    assert left_out == ["figures/kepler_stability.svg"]


@pytest.mark.slow
def test_page_of_own_systems_is_theirs_and_names_leftovers(tmp_path, monkeypatch):
    monkeypatch.setitem(SYSTEMS, "well", "well of the tests")
    folder = made.write_results(tmp_path / "own", systems=("well",))
    absolute = cube("well")
    absolute.max_energy_error.attrs |= {"long_name": "maximum of |H - H0| over every step", "units": "J"}
    write_cube(folder / "cubes/well.h5", absolute)
    write_cube(folder / "cubes/gone_away.h5", cube("gone_away"))
    for suffix in ("svg", "png"):
        (folder / f"figures/gone_away_energy_error.{suffix}").write_text(made.SVG)
    left = ["cubes/gone_away.h5", "figures/gone_away_energy_error.svg", "figures/gone_away_energy_error.png"]
    text = page(folder=folder, leftovers=left)["page"]
    found = Reader(text)
    first, *others = [words.partition(".")[0] for _, words in found.all("h3")]
    assert first == "Energy error against step size: well of the tests"
    assert others[:2] == ["Figure 2", "Figure 6"]
    assert [words for _, words in found.all("h1")] == ["Symplectic integrators: well of the tests"]
    assert "No system here is one of the paper's" in text
    assert "claims" not in [told.get("id") for told, _ in found.all("h2")]
    named = [words for _, words in found.all("code") if "gone" in words]
    assert named == ["cubes/gone_away", "figures/gone_away_energy_error"]
    assert text.count("gone_away") == 2
    assert "Maximum (A) and mean (B) energy error" in text
    assert "Energy errors are |ΔH| (J)." in text


def test_figures_of_own_systems_come_before_those_of_the_paper():
    figures = figures_of(["kepler", "well", "sho"], ["sho_terms", "substeps_displaced"])
    assert [one.stem for one in in_order(figures)] == [
        "gain", "well_energy_error", "fig1_sho", "fig2_decomposition", "fig4_perihelion", "fig5_kepler",
        "fig6_substeps", "fig6_displaced", "gain_mean",
    ]  # fmt: skip


def test_statements_are_folded_beneath_their_figures_worst_first(text):
    folded = dict(re.findall(r'<section class="figure[^>]*id="(figure-\d)"(.*?)</section>', text, re.DOTALL))
    ids = {anchor: re.findall(r'href="#claim-(\w+)"', words) for anchor, words in folded.items()}
    # Their sections name Figures 1, 3 and 5; the others need the oscillator's cube, which Figure 1 shows.
    assert ids["figure-3"] == ids["figure-5"] == ["two"]
    assert ids["figure-1"] == ["six", "seven", "one", "five"]


def test_plots_of_the_document_have_the_order_of_the_page(text, read):
    """Bokeh pairs them with ids by position: ids come from the document alone, and no list of them stands beside it."""
    roots = [root for one in documents(text) for root in one["roots"]]
    assert [root["attributes"]["name"] for root in roots] == re.findall(r'<div class="plot" id="(.*?)"', text)
    assert not any(f'"{root["id"]}"' in text for root in roots)


def test_every_file_is_linked_from_the_page_beside_it(results, text, read):
    linked = {told["href"] for told, _ in read.all("a") if told["href"][0] != "#"}
    places = [path for kind in ("cubes", "tables") for path in (results / kind).iterdir()]
    there = {path.relative_to(results).as_posix() for path in places}
    assert {name for name in there if name.endswith((".h5", ".csv"))} <= linked
    assert {f"figures/fig3_henon_heiles.{kind}" for kind in ("pdf", "svg", "png")} | {"figure-3.html"} <= linked
    of_gain = re.search(r'id="figure-gain".*?<p class="files">(.*?)</p>', text, re.DOTALL)[1]
    assert {f"cubes/{system}.h5" for system in ("henon_heiles", "kepler")} <= {*re.findall(r'href="(.*?)"', of_gain)}


def test_buttons_have_markers_where_curves_have_them(text):
    legends = re.findall(
        r'<section class="figure live" id="figure-(\w+)".*?<div class="legend(.*?)</div>', text, re.DOTALL
    )
    marks = {figure: [button.count("<path") for button in words.split("<button")[2:]] for figure, words in legends}
    assert marks == {figure: [1 if figure == "gain" else 2] * (2 if figure == "6" else 3) for figure in PLOTS}


@pytest.mark.slow
def test_a_figure_stands_alone_on_a_page_of_its_own(results):
    pages = page(folder=results)
    assert set(pages) == {"page", *(f"figure_{number}" for number in PLOTS)}
    found = Reader(pages["figure_3"])
    title = f"Figure 3. Energy error against step size: {SYSTEMS['henon_heiles']}"
    assert [words for _, words in found.all("h1")] == [title]
    assert {told["href"] for told, _ in found.all("a")} == {"report.html#figure-3"}
    (alone,) = documents(pages["figure_3"])
    assert [root["attributes"]["name"] for root in alone["roots"]] == ["figure-3-panel-1", "figure-3-panel-2"]
    assert alone in documents(pages["page"])
