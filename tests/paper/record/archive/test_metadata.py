"""Every MUST of RO-Crate 1.1 and of Workflow Run Crate 0.5 that binds who writes a crate, each with its section.

The texts are https://w3id.org/ro/crate/1.1, https://w3id.org/ro/wfrun/process/0.5,
https://w3id.org/ro/wfrun/workflow/0.5 and https://w3id.org/workflowhub/workflow-ro-crate/1.0. A MUST about something
that an archive does not hold (a thumbnail, a bag, formal parameters) is a test that it does not hold it. The preview
has tests of its own.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from datetime import datetime
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit
from zipfile import ZipFile

import pytest
from rocrate.rocrate import ROCrate

from nearharmonic_paper.record.archive import pack
from support.results import finished_results

#: Properties and types of the archive that the JSON-LD context of RO-Crate 1.1 defines.
CONTEXT_1_1 = {
    "ComputationalWorkflow", "ComputerLanguage", "CreateAction", "CreativeWork", "Dataset", "File", "Person",
    "ScholarlyArticle", "SoftwareApplication", "SoftwareSourceCode", "about", "actionStatus", "agent", "author",
    "citation", "conformsTo", "contentSize", "datePublished", "description", "encodingFormat", "endTime",
    "error", "hasPart", "identifier", "instrument", "keywords", "license", "mainEntity", "mentions", "name",
    "object", "programmingLanguage", "result", "softwareRequirements", "startTime", "url", "version",
}  # fmt: skip
STATUSES = {
    f"http://schema.org/{name}ActionStatus" for name in ("Active", "Completed", "Failed", "Potential")
}  # fmt: skip


PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5",
    "https://w3id.org/ro/wfrun/workflow/0.5",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
}


@pytest.fixture(scope="module")
def crate(tmp_path_factory):
    """The archive as ``rocrate`` reads it (``read``), its ``document``, its ``graph`` and its ``names``."""
    folder = tmp_path_factory.mktemp("crate")
    place = pack.save(finished_results.write_result(folder / "little"), folder / "little.zip", with_runs=True)
    with ZipFile(place) as zipped:
        document = json.loads(zipped.read("ro-crate-metadata.json"))
        names = zipped.namelist()
    return SimpleNamespace(read=ROCrate(place), document=document, graph=document["@graph"], names=names)


def entity(crate, identifier):
    (found,) = [each for each in crate.graph if each["@id"] == identifier]
    return found


def typed(crate, kind):
    found = [each for each in crate.graph if kind in values(each["@type"])]
    assert found
    return found


def values(value):
    return value if isinstance(value, list) else [value]


def references(value):
    return [each["@id"] for each in values(value)]


def is_iso_8601(text):
    return isinstance(text, str) and datetime.fromisoformat(text).tzinfo is not None


def is_uri(identifier):
    """A URI reference of RFC 3986: its characters only, each per cent sign before two hexadecimal digits."""
    return re.fullmatch(r"(?:[\w.~:/?#\[\]@!$&'()*+,;=-]|%[0-9A-Fa-f]{2})+", identifier, re.ASCII) is not None


# RO-Crate 1.1


def test_the_metadata_file_is_in_the_root_under_its_name(crate):
    """RO-Crate structure; RO-Crate Metadata File; Self-describing and self-contained."""
    assert crate.names.count("ro-crate-metadata.json") == 1
    assert crate.read.metadata.id == "ro-crate-metadata.json"


def test_every_data_entity_is_file_of_archive_or_on_web(crate):
    """RO-Crate structure: data entities are payload files or web-based."""
    local = [each for each in crate.read.data_entities if not urlsplit(each.id).scheme]
    assert len(local) == len(crate.names) - 2  # the metadata and their preview are no data
    for each in local:
        assert each.source.is_file(), each.id
        assert unquote(each.id) in crate.names


def test_the_metadata_are_flattened_and_compacted_json_ld(crate):
    """RO-Crate Metadata File: valid JSON-LD 1.0 in flattened and compacted form."""
    assert set(crate.document) == {"@context", "@graph"}
    for each in crate.graph:
        assert isinstance(each["@id"], str)
        for key, value in each.items():
            assert not (isinstance(value, list) and len(value) < 2), (each["@id"], key)
            for single in values(value):
                assert isinstance(single, str) or (set(single) == {"@id"} and isinstance(single["@id"], str))


def test_the_descriptor_describes_itself_and_names_the_root(crate):
    """RO-Crate Metadata File Descriptor: its @id, its @type, and about."""
    descriptor = entity(crate, "ro-crate-metadata.json")
    assert descriptor["@type"] == "CreativeWork"
    assert descriptor["about"] == {"@id": "./"}
    profiles = {"https://w3id.org/ro/crate/1.1", "https://w3id.org/workflowhub/workflow-ro-crate/1.0"}
    assert set(references(descriptor["conformsTo"])) == profiles
    assert crate.read.version == "1.1"


def test_root_is_dataset_with_name_description_date_and_licence(crate):
    """Direct properties of the Root Data Entity: those that it must have; the @id ends with a slash."""
    assert (crate.read.root_dataset.type, crate.read.root_dataset.id) == ("Dataset", "./")
    root = entity(crate, "./")
    assert root["name"]
    assert root["description"]
    assert root["license"]["@id"] in {each["@id"] for each in crate.graph}
    assert is_iso_8601(root["datePublished"])


def test_every_file_is_a_part_of_the_root(crate):
    """Referencing files and folders from the Root Data Entity: hasPart."""
    parts = references(entity(crate, "./")["hasPart"])
    assert sorted(parts) == sorted(each["@id"] for each in typed(crate, "File"))


def test_every_file_of_archive_is_file_with_relative_uri_path(crate):
    """File Data Entity: @type and @id; Encoding file paths; Describing entities in JSON-LD."""
    for name in set(crate.names) - {"ro-crate-metadata.json", "ro-crate-preview.html"}:
        (found,) = [each for each in crate.graph if unquote(each["@id"]) == name]
        assert "File" in values(found["@type"])
    for each in typed(crate, "File"):
        assert is_uri(each["@id"]), each["@id"]
        assert not urlsplit(each["@id"]).scheme
        assert not each["@id"].startswith(("/", "../", "#"))
    assert all(is_uri(each["@id"]) for each in crate.graph)


def test_no_two_entities_have_one_id(crate):
    """Contextual vs Data entities: one object for each entity, no @id twice."""
    assert set(Counter(each["@id"] for each in crate.graph).values()) == {1}


def test_every_entity_that_is_referenced_exists(crate):
    """Describing entities in JSON-LD; the specification, states of actions and pages of a language are on the web."""
    known = {each["@id"] for each in crate.graph}
    elsewhere = {"https://w3id.org/ro/crate/1.1", *STATUSES}
    elsewhere |= {
        one
        for each in typed(crate, "ComputerLanguage")
        for key in ("identifier", "url")
        for one in references(each[key])
    }
    linked = {
        single["@id"]
        for each in crate.graph
        for value in each.values()
        for single in values(value)
        if isinstance(single, dict)
    }
    assert linked - known <= elsewhere


def test_the_publication_is_cited_by_its_url(crate):
    """Publications via citation property."""
    (cited,) = references(entity(crate, "./")["citation"])
    assert cited == "https://arxiv.org/abs/1501.04345"
    assert entity(crate, cited)["@type"] == "ScholarlyArticle"


def test_an_action_has_an_object_times_and_a_status(crate):
    """Recording changes to RO-Crates: object, startTime and endTime in ISO 8601, actionStatus."""
    parts = references(entity(crate, "./")["hasPart"])
    for action in typed(crate, "CreateAction"):
        assert set(references(action["object"])) & {"./", *parts}
        assert is_iso_8601(action["startTime"])
        assert "endTime" not in action or is_iso_8601(action["endTime"])
        assert action["actionStatus"]["@id"] in STATUSES


def test_a_software_application_has_name_url_and_version(crate):
    """Describing scripts and workflows: contextual entity of a SoftwareApplication."""
    for software in typed(crate, "SoftwareApplication"):
        assert software["name"]
        assert software["version"]
        assert urlsplit(software["url"]).scheme == "https"


def test_every_term_is_in_the_context(crate):
    """RO-Crate JSON-LD, Adding new or ad hoc vocabulary terms: the URI of a term is in the local context."""
    reference, local = crate.document["@context"]
    assert reference == "https://w3id.org/ro/crate/1.1/context"
    assert local == {"sha256": "http://schema.org/sha256"}
    keys = {key for each in crate.graph for key in each if not key.startswith("@")}
    kinds = {kind for each in crate.graph for kind in values(each["@type"])}
    assert keys | kinds == CONTEXT_1_1 | set(local)


# Process Run Crate 0.5, Workflow Run Crate 0.5, Workflow RO-Crate 1.0


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_the_root_conforms_to_the_profile(crate, profile):
    """Requirements, Dataset: conformsTo references a CreativeWork with the versioned permalink."""
    assert set(references(entity(crate, "./")["conformsTo"])) == PROFILES
    assert entity(crate, profile)["@type"] == "CreativeWork"
    assert entity(crate, profile)["version"] == profile.rpartition("/")[2]


def test_there_is_one_action_with_its_tools_for_each_run(crate):
    """Requirements, CreateAction and SoftwareApplication: @type and a unique @id; mentions of the root."""
    for action in typed(crate, "CreateAction"):
        tools = [entity(crate, tool)["@type"] for tool in references(action["instrument"])]
        assert tools == [["File", "SoftwareSourceCode", "ComputationalWorkflow"], "SoftwareApplication"]
        assert entity(crate, action["agent"]["@id"])["@type"] == "Person"
    actions = [action["@id"] for action in typed(crate, "CreateAction")]
    assert sorted(actions) == sorted(f"#run-{run['id']}" for run in finished_results.HISTORY)
    assert sorted(references(entity(crate, "./")["mentions"])) == sorted(actions)


def test_the_main_entity_is_the_snakefile(crate):
    """Workflow RO-Crate, Main Workflow: mainEntity, @type, programmingLanguage."""
    assert entity(crate, "./")["mainEntity"] == {"@id": "Snakefile"}
    workflow = entity(crate, "Snakefile")
    assert workflow["@type"] == ["File", "SoftwareSourceCode", "ComputationalWorkflow"]
    assert "Snakefile" in crate.names
    language = entity(crate, workflow["programmingLanguage"]["@id"])
    assert (language["@type"], language["name"]) == ("ComputerLanguage", "Snakemake")
    assert not {"input", "output"} & workflow.keys()
    assert set(references(workflow["hasPart"])) == {name for name in crate.names if name.startswith("workflow/")}


def test_the_readme_is_about_the_archive(crate):
    """Workflow RO-Crate, Crate: README.md."""
    readme = entity(crate, "README.md")
    assert (readme["about"], readme["encodingFormat"]) == ({"@id": "./"}, "text/markdown")
