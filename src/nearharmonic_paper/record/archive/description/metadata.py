"""Metadata of an archive: RO-Crate 1.1 with the profile Workflow Run Crate 0.5, made with the library ``rocrate``.

The library uses today's date and random names by default. Here every date comes from the history and every name from
the content, so that equal results give equal bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from nearharmonic_paper.record.archive.description import workflow
from nearharmonic_paper.record.archive.description.member import Member, format_of
from nearharmonic_paper.record.archive.description.software import HOMES, citation, homepage
from nearharmonic_paper.record.archive.description.summary import KEYWORDS, Run, abstract, title

#: Names of the metadata in the archive and of their preview.
METADATA, PREVIEW = "ro-crate-metadata.json", "ro-crate-preview.html"
#: Profiles of the archive, by address: name and version.
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
#: The term is in schema.org; the context of RO-Crate 1.1 is older.
TERMS = {"sha256": "http://schema.org/sha256"}


def published(runs: Sequence[Run]) -> str:
    """Return the end time of the newest of ``runs`` (oldest first), or its start time if it was killed."""
    return _moment(runs[-1]["end"] or runs[-1]["start"])


def _moment(utc: str) -> str:
    """Return ``utc`` with a numeric offset, as validators of the profile require."""
    return utc.removesuffix("Z") + "+00:00"


def metadata(
    result: str, members: Sequence[Member], runs: Sequence[Run], configs: Mapping[str, str], left_out: int
) -> bytes:
    """Describe the files and the runs of an archive.

    Parameters
    ----------
    result
        Name of the result.
    members
        All files of the archive except the metadata and their preview; the workflow is among them.
    runs
        The history, oldest first; at least one run.
    configs
        Path in the archive of the config of each run, by the id of the run.
    left_out
        Number of trajectory files that are not in the archive.

    Returns
    -------
    bytes
        RO-Crate JSON-LD in UTF-8, with sorted keys and entities.

    Raises
    ------
    ResultFileError
        ``CITATION.cff`` is missing from the installation.
    """
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.1")
    crate.metadata.extra_terms.update(TERMS)
    cited = citation()
    _describe_root(crate, result, cited, runs, left_out)
    files = {member.path: _add_file(crate, member, cited) for member in members}
    _describe_workflow(crate, files)
    made: dict[str | None, list[Any]] = {}
    for member in members:
        made.setdefault(member.run, []).append(files[member.path])
    for run in runs:
        _add_action(crate, run, cited, files[configs[run["id"]]], made.get(run["id"], []))
    return _text(crate.metadata.generate())


def _add(crate: Any, identifier: str, **properties: Any) -> Any:
    """Return the contextual entity ``identifier`` of ``crate``; add it if it is missing."""
    return crate.get(identifier) or crate.add_jsonld({"@id": identifier, "@type": properties.pop("type"), **properties})


def _describe_root(crate: Any, result: str, cited: Mapping[str, Any], runs: Sequence[Run], left_out: int) -> None:
    root = crate.root_dataset
    root["name"] = title(result)
    root["description"] = abstract(runs, left_out)
    root["datePublished"] = published(runs)
    root["keywords"] = ", ".join(KEYWORDS)
    root["conformsTo"] = [
        _add(crate, address, type="CreativeWork", name=name, version=version)
        for address, (name, version) in PROFILES.items()
    ]
    root["author"] = _operator(crate)
    root["license"] = _add(
        crate,
        f"https://spdx.org/licenses/{cited['license']}",
        type="CreativeWork",
        name=f"{cited['license']} license",
        description="The text of the licence is the file LICENSE of this archive.",
    )
    root["citation"] = [_publication(crate, reference) for reference in cited["references"]]


def _publication(crate: Any, reference: Mapping[str, Any]) -> Any:
    authors = []
    for author in reference["authors"]:
        name = f"{author['given-names']} {author['family-names']}"
        authors.append(_add(crate, f"#{name.lower().replace(' ', '-')}", type="Person", name=name))
    return _add(
        crate,
        reference["url"],
        type="ScholarlyArticle",
        name=reference["title"],
        datePublished=str(reference["year"]),
        author=authors,
    )


def _operator(crate: Any) -> Any:
    description = "Who started the runs; the history does not keep the name."
    return _add(crate, "#operator", type="Person", name="Operator of the workflow", description=description)


def _add_file(crate: Any, member: Member, cited: Mapping[str, Any]) -> Any:
    properties = {
        "name": member.path,
        "description": member.description,
        "contentSize": str(member.size),
        "sha256": member.sha256,
        "encodingFormat": format_of(member.path)[0],
    }
    if member.path == workflow.MAIN:
        properties |= workflow.described(crate, cited)
    elif member.path == "README.md":
        properties["about"] = crate.root_dataset
    return crate.add_file(dest_path=member.path, properties=properties)


def _describe_workflow(crate: Any, files: Mapping[str, Any]) -> None:
    """Describe the preview, and make the Snakefile the main entity; the other files of the workflow are its parts."""
    crate.metadata.append_to("conformsTo", {"@id": next(reversed(PROFILES))})
    _add(
        crate, PREVIEW, type="CreativeWork", name="Preview of this archive", about=crate.root_dataset,
        encodingFormat="text/html",
    )  # fmt: skip
    crate.root_dataset["mainEntity"] = main = files[workflow.MAIN]
    main["hasPart"] = [file for path, file in files.items() if path.startswith("workflow/")]


def _add_action(crate: Any, run: Run, cited: Mapping[str, Any], config: Any, made: Sequence[Any]) -> None:
    done = run["status"] == "ok"
    action = _add(
        crate,
        f"#run-{run['id']}",
        type="CreateAction",
        name=f"Run {run['id']} of the workflow",
        description=_run_in_words(run),
        startTime=_moment(run["start"]),
        actionStatus={"@id": f"http://schema.org/{'Completed' if done else 'Failed'}ActionStatus"},
        instrument=[crate.root_dataset["mainEntity"], _instrument(crate, run, cited)],
        object=config,
        agent=_operator(crate),
    )
    if run["end"]:
        action["endTime"] = _moment(run["end"])
    if not done:
        killed = run["status"] == "killed"
        action["error"] = "killed before its end" if killed else f"exit status {run['exit_status']}"
    if made:
        action["result"] = list(made)
    crate.root_dataset.append_to("mentions", action)


def _run_in_words(run: Run) -> str:
    words = [f"{' '.join(run['command'])}: {run['status']}"]
    words += [f"targets {', '.join(run['targets'])}"] if run["targets"] else []
    words += [f"{run['duration']:.1f} s on {run['cores']} cores"] if run["duration"] is not None else []
    words += [f"{run['jobs_run']} jobs run, {run['jobs_reused']} reused"] if run["jobs_run"] is not None else []
    words.append(str(run["platform"]))
    return "; ".join(words)


def _instrument(crate: Any, run: Run, cited: Mapping[str, Any]) -> Any:
    """Return the software of ``run``: one entity for each combination of code and libraries."""
    versions = run["versions"]
    version = versions["nearharmonic"]
    if run["commit"]:
        version += f"+{run['commit']}" + (".dirty" if run["dirty"] else "")
    same = json.dumps([version, run["code_digest"], versions], sort_keys=True)
    libraries = [
        _add(
            crate, f"#{name}-{versions[name]}", type="SoftwareApplication", name=name, version=versions[name],
            url=HOMES[name],
        )
        for name in sorted(HOMES.keys() & versions.keys())
    ]  # fmt: skip
    changed = ", with changes that are not committed" if run["dirty"] else ""
    return _add(
        crate,
        f"#nearharmonic-{hashlib.sha256(same.encode()).hexdigest()[:12]}",
        type="SoftwareApplication",
        name="nearharmonic",
        version=version,
        url=homepage(cited),
        description=f"{cited['title']}; commit {run['commit'] or 'unknown'}{changed}, code {run['code_digest']}",
        softwareRequirements=libraries,
    )


def _text(document: Mapping[str, Any]) -> bytes:
    first = {METADATA: 0, "./": 1}
    graph = sorted(document["@graph"], key=lambda entity: (first.get(entity["@id"], 2), entity["@id"]))
    flat = {"@context": document["@context"], "@graph": [_compacted(entity) for entity in graph]}
    return json.dumps(flat, indent=1, sort_keys=True, ensure_ascii=False).encode() + b"\n"


def _compacted(entity: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``entity`` with lists of one value replaced by the value, and without empty lists."""
    pairs: Iterable[tuple[str, Any]] = ((key, value) for key, value in entity.items() if value != [])
    return {key: value[0] if isinstance(value, list) and len(value) == 1 else value for key, value in pairs}
