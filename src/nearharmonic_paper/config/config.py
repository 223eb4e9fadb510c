"""The config: its keys as frozen dataclasses."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, make_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from nearharmonic.engine.settings import MOST_SAMPLES, Sweep, shared_settings_from
from nearharmonic.integrators import expanded, integrators, plain_integrators
from nearharmonic.output.atomic import write_text
from nearharmonic.output.table import pipes
from nearharmonic.systems import systems
from nearharmonic_paper.entries import POSITIVE, STRICT, PositiveNumber, Reading, setting, whole_from
from nearharmonic_paper.experiments.paper.experiment import Summation, SystemSettings
from nearharmonic_paper.experiments.paper.run import PAPER, suitable_shards
from nearharmonic_paper.tasks.experiment import beside_the_paper, experiments

#: Maximum length of a name: file systems allow 255 bytes.
LONGEST_NAME = 100

_NAME = rf"^[A-Za-z0-9][A-Za-z0-9_.-]{{0,{LONGEST_NAME - 1}}}\Z"
METHODS = "a list of at least one integrator, each named once"
METHOD = "the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS"
#: Lists of numbers, in which a number may occur twice.
NUMBERS = ("q0", "p0")


def _name(value: object) -> str:
    import re

    if not isinstance(value, str) or re.match(_NAME, value, re.ASCII) is None:
        raise ValueError
    return value


Name = Annotated[str, Reading(_name, (("type", "string"), ("pattern", _NAME.replace(r"\Z", "$"))))]


@dataclass(frozen=True, kw_only=True)
class Config:
    """One reproduction; its results go to results/<name>/.

    :func:`whole_config` is the type of configs: it includes the sections of the experiments.
    """

    __pydantic_config__ = STRICT

    name: Name = setting(
        "Names the folder of the results, `results/<name>/`",
        f"letters, digits, '_', '-' and '.', beginning with a letter or digit, at most {LONGEST_NAME}",
    )
    integrators: tuple[str, ...] = setting(
        "The methods, in the order of the legends", METHODS, each=METHOD, min_length=1
    )
    systems: Mapping[str, SystemSettings] = setting(
        "The Hamiltonian systems, by name; each holds the keys below", "at least one system by its name", min_length=1
    )
    samples: int = setting(
        "States that a run keeps; the largest and the mean error see every step all the same. 0 keeps the reduced "
        "numbers alone, those of 500 states",
        default=500,
        **whole_from(0, MOST_SAMPLES),
    )
    job_seconds: PositiveNumber = setting(
        "Time for which the work of one job is planned; it determines the shards", POSITIVE, unit="s", default=5.0
    )
    shards: int | None = setting(
        "Jobs, and files, that share the step sizes of one method on one system; if not given, as few as keep a job "
        "near job_seconds and its trajectories below 4e8 bytes",
        default=None,
        **whole_from(1, 10**6),
    )
    summation: Summation = setting(
        "Summation of the state in double precision, with or without the carry of the rounding error",
        "one of compensated, plain",
        default="compensated",
    )
    decomposition: tuple[str, ...] | None = setting(
        "The methods of figure 2, and those of files in integrators; all integrators if not given",
        METHODS,
        each=METHOD,
        default=None,
        min_length=1,
    )
    overview: tuple[str, ...] | None = setting(
        "The methods of the table that compares all, and those of files in integrators; all whose kicks are of V alone "
        "if not given",
        METHODS,
        each=METHOD,
        default=None,
        min_length=1,
    )

    background: Literal["white", "transparent"] = setting(
        "Background of the SVG files of figures; PDF and PNG files are white",
        "one of white, transparent",
        default="white",
    )

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the integrators, including those from files."""
        return expanded(self.integrators)

    @property
    def stepwise(self) -> tuple[str, ...]:
        """Names of the integrators whose energy is measured at every step: all except processed ones."""
        return tuple(name for name in self.methods if not integrators[name].processed)

    @property
    def has_systems_of_the_paper(self) -> bool:
        """True if statements of the paper, and long orbits of its systems, are of interest."""
        return not self.systems.keys().isdisjoint(PAPER)

    @property
    def sweeps(self) -> tuple[Sweep, ...]:
        """Sweep of each system; t_end is by default that of the system."""
        return tuple(self._sweep(name, asked) for name, asked in self.systems.items())

    def _sweep(self, name: str, asked: SystemSettings) -> Sweep:
        sweep = Sweep(
            system=name,
            t_end=asked.t_end or systems[name].t_end,
            lowest=asked.tau_per_stage.lowest,
            highest=asked.tau_per_stage.highest,
            points_per_decade=asked.tau_per_stage.points_per_decade,
            precision=asked.precision,
            samples=self.samples,
            **shared_settings_from(asked, self),
            shards=self.shards or 1,
        )
        return sweep if self.shards else replace(sweep, shards=suitable_shards(sweep, self.job_seconds))

    @property
    def compared(self) -> tuple[str, ...]:
        """The methods of the table that compares all methods."""
        return tuple(plain_integrators) if self.overview is None else self._with_own(self.overview)

    @property
    def decomposed(self) -> tuple[str, ...]:
        """The methods of figure 2."""
        return self.methods if self.decomposition is None else self._with_own(self.decomposition)

    def _with_own(self, entries: tuple[str, ...]) -> tuple[str, ...]:
        """Return the methods of a list, and those of users' files among the integrators."""
        own = (name for name in self.methods if name in integrators.definitions)
        return tuple(dict.fromkeys((*expanded(entries), *own)))


@cache
def sections() -> dict[str, type]:
    """Return the types of the sections that experiments declare, by key."""
    return {one.key: one.settings for one in experiments().values() if one.settings is not None}


@cache
def whole_config() -> type[Config]:
    """Return the type of configs: the keys of :class:`Config`, and the section of each experiment."""
    effects = {one.key: one.effect for one in experiments().values()}
    return make_dataclass(
        "WholeConfig",
        [(key, kind, setting(effects[key], default=kind)) for key, kind in sections().items()],
        bases=(Config,),
        namespace={"__doc__": "One reproduction; its results go to results/<name>/.", "__module__": __name__},
        frozen=True,
        kw_only=True,
    )


@cache
def adapter() -> Any:
    """Return pydantic's reader of configs; it is created lazily, because this takes 0.1 s."""
    from pydantic import TypeAdapter

    return TypeAdapter(whole_config())


# --- Generator of the JSON schema, and of tables in documents: keys, cubes and targets.
#
# The sources are the types of the config and the declarations of the experiments. ``python -m
# nearharmonic_paper.config.config`` writes all of them.

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
