"""The preview of an archive: its MUSTs in RO-Crate 1.1, its lists, and that no text in it becomes markup."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections import defaultdict
from html.parser import HTMLParser
from pathlib import PurePosixPath
from urllib.parse import unquote
from zipfile import ZipFile

import pytest

from nearharmonic_paper.record.archive import pack
from support.results import finished_results
from support.results.finished_results import FILES, HISTORY, NEWER

#: Elements and attributes by which a browser loads something of itself.
LOADING = {"img", "iframe", "object", "embed", "video", "audio", "source", "base", "input", "svg", "form", "frame"}
LOADED = {"src", "srcset", "background", "poster", "action", "data", "style", "ping"}
HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;'\""


class Seen(HTMLParser):
    """Elements, attributes and words of a page."""

    def __init__(self, page):
        super().__init__()
        self.attributes, self.words = defaultdict(list), ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.attributes[tag].append(dict(attrs))

    def handle_data(self, data):
        self.words += data


def saved(folder, files=FILES, history=HISTORY):
    """The page and the metadata of the archive of a result with these files and runs."""
    result = finished_results.write_result(folder / "little")
    for path, (content, _) in files.items():
        (result / path).parent.mkdir(parents=True, exist_ok=True)
        (result / path).write_bytes(content)
    finished_results.write_manifest(result, {path: finished_results.entry(*made) for path, made in files.items()})
    finished_results.write_history(result, history)
    with ZipFile(pack.save(result, folder / "little.zip", with_runs=True)) as zipped:
        return zipped.read("ro-crate-preview.html").decode(), zipped.read("ro-crate-metadata.json").decode()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    more = {f"figures/fig{i}.{kind}": (b"x", NEWER) for i in range(7) for kind in ("pdf", "png", "svg")}
    return saved(tmp_path_factory.mktemp("preview"), {**FILES, **more})


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A result whose file, target, command and platform are markup."""
    name = f"tables/{HOSTILE.replace('/', '_')}.csv"
    run = HISTORY[-1] | {"targets": [HOSTILE], "command": ["snakemake", HOSTILE], "platform": HOSTILE}
    files = {**FILES, name: (b"1\n", NEWER)}
    return saved(tmp_path_factory.mktemp("hostile"), files, [*HISTORY[:-1], run])


def links(page):
    return [one["href"] for one in Seen(page).attributes["a"]]


def test_preview_is_well_formed_html_with_one_title(made):
    """Structure, RO-Crate Website: a valid HTML 5 document; this one is XML too."""
    page, _ = made
    assert page.startswith("<!DOCTYPE html>\n")
    tree = ET.fromstring(page)
    assert [one.tag for one in tree] == ["head", "body"]
    assert tree.findtext("head/title") == tree.findtext("body/h1") == "nearharmonic results: little"
    names = [one.get("id") for one in tree.iter() if one.get("id")]
    assert len(names) == len(set(names))


def test_preview_has_a_copy_of_the_metadata_in_its_head(made):
    """Structure, RO-Crate Website: a script element of the head."""
    page, metadata = made
    (script,) = ET.fromstring(page).findall("head/script")
    assert script.attrib == {"type": "application/ld+json"}
    assert json.loads(script.text) == json.loads(metadata)


def test_preview_lists_every_figure_with_all_its_formats(made):
    page, metadata = made
    graph = json.loads(metadata)["@graph"]
    figures = {unquote(one["@id"]) for one in graph if one["@id"].startswith("figures/")}
    assert len(figures) == 2 + 3 * 7
    tables = dict(re.findall(r"<h2>(.*?)</h2>\s*(<table>.*?</table>)", page, flags=re.DOTALL))
    assert {unquote(one) for one in links(tables["Figures"])} == {f"./{name}" for name in figures}
    rows = re.findall(r"<tr><td>(\S+)</td>", tables["Figures"])
    assert sorted(rows) == sorted({PurePosixPath(name).stem for name in figures})


def test_preview_links_every_file_of_the_archive_once(made):
    page, metadata = made
    files = [one["@id"] for one in json.loads(metadata)["@graph"] if "File" in one["@type"]]
    lists = page.partition("<h2>")[2].partition("<h2>Runs of the workflow")[0]
    assert sorted(links(lists)) == sorted(f"./{one}" for one in files)


def test_preview_shows_each_run_and_each_software(made):
    page, metadata = made
    shown = {one["id"] for one in Seen(page).attributes["tr"] if "id" in one}
    graph = json.loads(metadata)["@graph"]
    assert shown == {one["@id"][1:] for one in graph if one["@type"] in ("CreateAction", "SoftwareApplication")}
    assert {one for one in links(page) if one.startswith("#")} <= {f"#{one}" for one in shown}


def test_preview_makes_no_request(made):
    page, _ = made
    seen = Seen(page)
    assert not LOADING & seen.attributes.keys()
    attributes = [(tag, name) for tag, several in seen.attributes.items() for one in several for name in one]
    assert not [(tag, name) for tag, name in attributes if name in LOADED or name.startswith("on")]
    assert [one["rel"] for one in seen.attributes["link"]] == ["describedby"]
    (style,) = re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL)
    assert not re.search(r"url|@import|expression", style)
    policies = [one["content"] for one in seen.attributes["meta"] if one.get("http-equiv") == "Content-Security-Policy"]
    assert policies == ["default-src 'none'; style-src 'unsafe-inline'"]


def test_texts_of_a_result_are_no_markup(hostile):
    page, metadata = hostile
    ET.fromstring(page)
    seen = Seen(page)
    assert len(seen.attributes["script"]) == 1
    assert not LOADING & seen.attributes.keys()
    assert seen.words.count(HOSTILE) >= 3
    assert json.loads(re.search(r"ld\+json\">(.*?)</script>", page)[1]) == json.loads(metadata)


def test_links_stay_in_the_archive_or_lead_to_the_web(hostile):
    page, _ = hostile
    assert all(re.match(r"https?://|#|\./", one) for one in links(page))
