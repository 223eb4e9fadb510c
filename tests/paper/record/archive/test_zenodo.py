"""Metadata for Zenodo: its keys and vocabularies, and the citation file as their source."""

from __future__ import annotations

import json
from pathlib import Path
from zipfile import ZipFile

import pytest
import yaml

from nearharmonic_paper.record.archive import pack
from nearharmonic_paper.record.archive.description.zenodo import zenodo
from support.results import finished_results

CITED = yaml.safe_load((Path(__file__).parents[4] / "CITATION.cff").read_text(encoding="utf-8"))
#: Keys of deposit metadata in Zenodo's REST API that are used, with their required ones first; https://developers.zenodo.org
REQUIRED = {"title", "upload_type", "description", "creators", "access_right", "license"}
OPTIONAL = {"keywords", "language", "related_identifiers"}
SCHEMES = {"arxiv", "doi", "url"}
RELATIONS = {"references", "isCompiledBy"}
PEOPLE = [
    {"family-names": "Noether", "given-names": "Emmy", "affiliation": "Göttingen", "orcid": "https://orcid.org/0000-0002-1825-0097"},
    {"family-names": "Störmer", "given-names": "Carl"},
]  # fmt: skip


@pytest.fixture(scope="module")
def archived(tmp_path_factory):
    """The metadata in an archive, and those of the crate."""
    folder = tmp_path_factory.mktemp("zenodo")
    with ZipFile(pack.save(finished_results.write_result(folder / "little"), folder / "little.zip")) as zipped:
        crate = json.loads(zipped.read("ro-crate-metadata.json"))
        return json.loads(zipped.read(".zenodo.json")), {one["@id"]: one for one in crate["@graph"]}


def test_deposit_has_the_required_keys_and_no_date(archived):
    deposit, _ = archived
    assert deposit.keys() == REQUIRED | OPTIONAL
    assert (deposit["upload_type"], deposit["access_right"]) == ("dataset", "open")


def test_deposit_says_what_the_crate_says(archived):
    deposit, crate = archived
    root = crate["./"]
    assert deposit["title"] == root["name"]
    assert deposit["description"] == f"<p>{root['description']}</p>"
    assert ", ".join(deposit["keywords"]) == root["keywords"]
    assert root["license"]["@id"] == f"https://spdx.org/licenses/{deposit['license']}"


def test_creators_and_licence_are_those_of_the_citation_file(archived):
    deposit, _ = archived
    assert [one["name"] for one in deposit["creators"]] == [one["name"] for one in CITED["authors"]]
    assert deposit["license"] == CITED["license"]


def test_deposit_refers_to_the_paper_and_to_the_software(archived):
    deposit, _ = archived
    related = deposit["related_identifiers"]
    assert [one["identifier"] for one in related] == ["arXiv:1501.04345", CITED["repository-code"]]
    assert {one["scheme"] for one in related} <= SCHEMES
    assert {one["relation"] for one in related} == RELATIONS


def test_people_are_creators_with_family_names_first():
    deposit = json.loads(zenodo("little", CITED | {"authors": PEOPLE}, finished_results.HISTORY, 0))
    assert deposit["creators"] == [
        {"name": "Noether, Emmy", "affiliation": "Göttingen", "orcid": "0000-0002-1825-0097"},
        {"name": "Störmer, Carl"},
    ]


def test_published_article_is_referred_to_by_its_address():
    article = {"title": "Some", "authors": [], "year": 1918, "url": "https://doi.org/10.1000/1"}
    deposit = json.loads(zenodo("little", CITED | {"references": [article]}, finished_results.HISTORY, 0))
    assert deposit["related_identifiers"][0] == {
        "identifier": "https://doi.org/10.1000/1", "relation": "references", "resource_type": "publication-article",
        "scheme": "url",
    }  # fmt: skip
