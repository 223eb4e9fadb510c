"""Generator of the JSON schema, and of tables in documents: keys, cubes and targets.

The sources are the types of the config and the declarations of the experiments. ``python -m
nearharmonic_paper.config.schema`` writes all of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from nearharmonic.output.atomic import write_text
from nearharmonic.output.page import pipes
from nearharmonic_paper.config.config import adapter
from nearharmonic_paper.tasks.experiment import beside_the_paper, experiments

#: The generated files, from the root of the project.
SCHEMA, KEYS = Path("workflow/schemas/config.schema.yaml"), Path("config/README.md")
#: Pages with generated rows of a table: the text before the rows, and the pattern of a row.
CUBES, TARGETS = Path("docs/how_to/files.md"), Path("docs/index.md")
_ROWS = {
    CUBES: re.compile(r"(\n\| `cubes/\{system\}\.h5` .*\n)(?:\| `cubes/\w+\.h5` .*\n)*"),
    TARGETS: re.compile(r"(\n\| `snakemake -j2` .*\n)(?:\| `snakemake -j2 (?!everything)\w+` .*\n)*"),
}


@cache
def schema() -> dict[str, Any]:
    """Return the JSON schema of configs, with the additional keywords ``unit`` and ``allowed`` (the text in errors)."""
    found = adapter().json_schema()
    definitions = found.pop("$defs")
    inlined: dict[str, Any] = _inlined(found, definitions)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | inlined


def _inlined(member: Any, definitions: Mapping[str, Any]) -> Any:
    """Return ``member`` of a schema with resolved references, and without titles that repeat keys."""
    if isinstance(member, list):
        return [_inlined(part, definitions) for part in member]
    if not isinstance(member, Mapping):
        return member
    whole = dict(definitions[member["$ref"].rpartition("/")[2]]) if "$ref" in member else {}
    whole |= {key: value for key, value in member.items() if key != "$ref"}
    options = [part for part in whole.pop("anyOf", []) if part.get("type") != "null"]
    for option in options:
        whole = {**option, **{key: value for key, value in whole.items() if value is not None}}
    if "properties" in whole:
        whole.setdefault("allowed", f"the keys {' and '.join(', '.join(whole['properties']).rsplit(', ', 1))}")
    kept = {
        key: ({name: _inlined(part, definitions) for name, part in value.items()} if key == "properties" else value)
        for key, value in whole.items()
        if key != "title"
    }
    return {key: value if key == "properties" else _inlined(value, definitions) for key, value in kept.items()}


def key_table(described: Mapping[str, Any]) -> str:
    """Return the keys of the schema ``described`` as a Markdown table, one line per key."""
    rows = []
    for key, member, required in _keys(described, ""):
        default = "required" if required else str(member.get("default", "")).replace("'", "")
        rows.append((f"`{key}`", default, member["allowed"], member.get("unit", ""), member["description"]))
    return "\n".join(pipes(["key", "default", "allowed", "unit", "meaning"], rows))


def _keys(described: Mapping[str, Any], above: str) -> Iterator[tuple[str, Mapping[str, Any], bool]]:
    for key, member in described.get("properties", {}).items():
        yield above + key, member, key in described.get("required", ())
        yield from _keys(member, f"{above}{key}.")
        other = member.get("additionalProperties")
        if isinstance(other, Mapping):
            yield from _keys(other, f"{above}{key}.<name>.")


def cube_rows() -> str:
    """Return the cubes of all experiments as rows of a Markdown table: file, dimensions, contents."""
    cubes = {stem: told for one in experiments().values() for stem, told in one.cubes.items()}
    return "".join(f"| `cubes/{stem}.h5` | {' | '.join(told)} |\n" for stem, told in cubes.items())


def target_rows() -> str:
    """Return the targets of all experiments as rows of a Markdown table: command, content, time."""
    told = ((one, one.about[0].lower() + one.about[1:].removesuffix(".")) for one in beside_the_paper())
    return "".join(f"| `snakemake -j2 {one.target}` | {about} | {one.duration} |\n" for one, about in told)


def write_generated(root: Path = Path()) -> None:
    """Write the schema, and the tables of keys, cubes and targets into their pages, below the folder ``root``."""
    import yaml

    described = schema()
    write_text(root / SCHEMA, yaml.safe_dump(described, sort_keys=False, width=110))
    page = (root / KEYS).read_text(encoding="utf-8")
    before = page.partition("| key |")[0]
    write_text(root / KEYS, f"{before}{key_table(described)}\n")
    for place, rows in ((CUBES, cube_rows()), (TARGETS, target_rows())):
        text = (root / place).read_text(encoding="utf-8")
        head = _ROWS[place].search(text)
        if head is not None:
            write_text(root / place, f"{text[: head.start()]}{head[1]}{rows}{text[head.end() :]}")


if __name__ == "__main__":
    write_generated()
