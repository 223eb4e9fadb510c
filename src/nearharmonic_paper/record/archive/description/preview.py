"""The preview of an archive, ``ro-crate-preview.html`` of RO-Crate 1.1: one page that needs no other file.

The library ``rocrate`` has a preview of its own. It inserts texts without escaping, and it lacks the copy of the
metadata that RO-Crate 1.1 demands.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from nearharmonic_paper.record.archive.description.member import format_of
from nearharmonic_paper.record.archive.description.workflow import MAIN

TEMPLATE = Path(__file__).with_name("preview.html")
#: Properties of the archive, with their words on the page.
FACTS = {
    "datePublished": "Date",
    "license": "Licence",
    "keywords": "Keywords",
    "author": "Runs started by",
    "mainEntity": "Workflow",
    "conformsTo": "Profiles",
}
#: Groups of files by the folder at the beginning of their path; the last one has all others.
GROUPS = {"figures": "Figures", "tables": "Tables", "cubes": "Cubes", "runs": "Trajectories", "workflow": "Workflow"}
_OTHERS = "Other files"
#: Files to read first, where they are.
_FIRST = ("report.html", "README.md")
_OPENED, _CLOSED = b'<script type="application/ld+json">', b"</script>"

Entity = Mapping[str, Any]


def preview(metadata: bytes) -> bytes:
    """Return the page, HTML 5 in UTF-8, from the text of the metadata alone."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    document = json.loads(metadata)
    entities = {one["@id"]: one for one in document["@graph"]}
    files = [one for one in entities.values() if "File" in _several(one["@type"])]
    runs = [one for one in entities.values() if one["@type"] == "CreateAction"]
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.globals |= {"link": _link, "several": _several, "ending": _ending, "content": _content, "facts": FACTS}
    page = environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        json=Markup(_inert(document)),
        entities={identifier: _Lenient(one) for identifier, one in entities.items()},
        root=_Lenient(entities["./"]),
        begin=[one for name in _FIRST for one in files if one["@id"] == name],
        groups=_grouped(files),
        runs=[_Lenient(one) for one in sorted(runs, key=lambda run: str(run["startTime"]))],
        software=[_Lenient(one) for one in entities.values() if one["@type"] == "SoftwareApplication"],
    )
    return page.encode() + b"\n"


class _Lenient(dict[str, Any]):
    """An entity in which a missing property is None."""

    def __missing__(self, key: str) -> None:
        return None


def shown_in(page: bytes) -> Any:
    """Return the copy of the metadata in the page; None if there is none."""
    try:
        return json.loads(page.partition(_OPENED)[2].partition(_CLOSED)[0])
    except ValueError:
        return None


def _inert(document: Any) -> str:
    """Return JSON that no text in it can end: the characters of tags are escaped."""
    text = json.dumps(document, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _several(value: Any) -> list[Any]:
    return [] if value is None else value if isinstance(value, list) else [value]


def _link(identifier: str) -> str:
    """Return the target of a link: an address of the web, a place on this page, or a file of the archive."""
    return identifier if identifier.startswith(("https://", "http://", "#")) else f"./{identifier}"


def _ending(file: Entity) -> str:
    return _path(file).suffix.removeprefix(".").upper() or "TEXT"


def _content(file: Entity) -> str:
    """Return the description of a file without its format, for files that differ in it stand in one row."""
    return str(file["description"]).replace(f", {format_of(str(_path(file)))[1]}", "")


def _path(file: Entity) -> PurePosixPath:
    """Path of a file in the archive."""
    return PurePosixPath(unquote(file["@id"]))


def _grouped(files: Iterable[Entity]) -> dict[str, dict[str, list[Entity]]]:
    """Return the files below the headings of their groups, those that differ in their endings together."""
    groups: dict[str, dict[str, list[Entity]]] = {heading: {} for heading in (*GROUPS.values(), _OTHERS)}
    for file in files:
        path = _path(file)
        folder = "workflow" if str(path) == MAIN else path.parts[0]
        if folder in GROUPS:
            name = path.relative_to(folder) if len(path.parts) > 1 else path
            groups[GROUPS[folder]].setdefault(str(name.with_suffix("")), []).append(file)
        else:
            groups[_OTHERS][str(path)] = [file]
    return {heading: rows for heading, rows in groups.items() if rows}
