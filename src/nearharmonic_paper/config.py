"""The config of the workflow: its keys, its files, the systems and integrators that it defines, and its schema."""

from __future__ import annotations

import argparse
import errno
import keyword
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, make_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NoReturn, cast

from nearharmonic.engine.settings import MOST_SAMPLES, Sweep, one_of, shared_settings_from
from nearharmonic.errors import NearharmonicError, SettingError, UnknownNameError, bad_setting, unknown_name
from nearharmonic.integrators import TableauDefinition, expanded, integrators, load_tableaus, plain_integrators
from nearharmonic.numerics.written import decimal_of, integer_of
from nearharmonic.output.atomic import opened, write_text
from nearharmonic.output.table import pipes, printable
from nearharmonic.registry import is_file, is_path, split_path
from nearharmonic.systems import systems
from nearharmonic.systems.gradients import check_gradients
from nearharmonic.systems.user_file import SystemDefinition
from nearharmonic_paper.entries import POSITIVE, STRICT, PositiveNumber, setting, whole_from
from nearharmonic_paper.experiments.paper.experiment import Summation, SystemSettings
from nearharmonic_paper.experiments.paper.run import PAPER, check_sweep, suitable_shards
from nearharmonic_paper.tasks.experiment import beside_the_paper, experiments

# --- Keys of a config.

#: Maximum length of a name: file systems allow 255 bytes.
LONGEST_NAME = 100
_METHODS: dict[str, Any] = {
    "allowed": "a list of at least one integrator, each named once",
    "each": "the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
    "min_length": 1,
}


@dataclass(frozen=True, kw_only=True)
class Config:
    """One reproduction; its results go to results/<name>/.

    :func:`whole_config` is the type of configs: it includes the sections of the experiments.
    """

    __pydantic_config__ = STRICT

    name: str = setting(
        "Names the folder of the results, `results/<name>/`",
        f"letters, digits, '_', '-' and '.', beginning with a letter or digit, at most {LONGEST_NAME}",
        pattern=rf"^[A-Za-z0-9][A-Za-z0-9_.-]{{0,{LONGEST_NAME - 1}}}$",
    )
    integrators: tuple[str, ...] = setting("The methods, in the order of the legends", **_METHODS)
    systems: Mapping[str, SystemSettings] = setting(
        "The Hamiltonian systems, by name; each holds the keys below", "at least one system by its name", min_length=1
    )
    samples: int = setting(
        "States that a run keeps; the maximum and mean errors include every step. With 0, a run keeps only the "
        "numbers reduced from 500 states",
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
        "The methods of Figure 2, besides the methods of files in integrators; all integrators if not given",
        default=None,
        **_METHODS,
    )
    overview: tuple[str, ...] | None = setting(
        "The methods of the table of all methods, besides the methods of files in integrators; if not given, all with "
        "kicks of V alone",
        default=None,
        **_METHODS,
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
        """Sweep of each system; t_end is by default the system's own."""
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
        """Return the methods of a list, and the methods of users' files among the integrators."""
        own = (name for name in self.methods if name in integrators.definitions)
        return tuple(dict.fromkeys((*expanded(entries), *own)))


@cache
def whole_config() -> type[Config]:
    """Return the type of configs: the keys of :class:`Config`, and the section of each experiment with settings."""
    return make_dataclass(
        "WholeConfig",
        [(e.key, e.settings, setting(e.effect, default=e.settings)) for e in experiments().values() if e.settings],
        bases=(Config,),
        namespace={"__doc__": "One reproduction; its results go to results/<name>/.", "__module__": __name__},
        frozen=True,
        kw_only=True,
    )


@cache
def _adapter() -> Any:
    """Return pydantic's reader of configs; it is created lazily, because this takes 0.1 s."""
    from pydantic import TypeAdapter

    return TypeAdapter(whole_config())


# --- Files of configs, within limits: none takes long to read, and no key occurs twice in a mapping.

#: The config of a command that gives none.
CONFIGS = ["config/config.yaml"]
#: Key of a config that makes it a template, in which Snakemake runs Python expressions.
TEMPLATE = "__use_yte__"
#: Most bytes of a file, entries of it with those that its aliases repeat, and levels of nesting.
MOST_BYTES, MOST_ENTRIES, MOST_LEVELS = 10**6, 10**4, 20


def read_mapping(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the keys and values of a config in YAML 1.1 or JSON."""
    import yaml

    try:
        with opened(path) as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise OSError(errno.EFBIG, f"it has more than {MOST_BYTES} bytes")  # noqa: TRY301 - told as all others
        text = content.decode("utf-8-sig")
        if os.fspath(path).endswith(".json"):
            text = text.replace("\t", " ")  # which YAML does not allow between entries
        _check_size(text)
        mapping = yaml.load(text, Loader=_loader())
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise SettingError(f"{path} cannot be read as a config: {_reason(error)}") from None
    if not isinstance(mapping, dict):
        raise SettingError(f"{path} is no config: a mapping of the keys of a config to values is allowed")
    if TEMPLATE in mapping:
        raise bad_setting(TEMPLATE, mapping[TEMPLATE], f"a config is data, and Snakemake would run Python in {path}")
    return mapping


def _reason(error: Any) -> str:
    """Return the reason of an error of a file, of its characters, of YAML or of a value."""
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if isinstance(error, UnicodeDecodeError):
        return f"byte {error.start} is no text in UTF-8"
    if isinstance(error, ValueError):  # a number of thousands of digits, or a date such as 2026-13-01
        return f"a value in it is not allowed: {str(error).partition(';')[0]}"
    mark = getattr(error, "problem_mark", None)
    reason = getattr(error, "problem", None) or getattr(error, "reason", None) or "it is no YAML"
    return reason if mark is None else f"{reason} in line {mark.line + 1}"


def _check_size(text: str) -> None:
    """Count levels and entries, also repeated by aliases, without recursion: a text may be deep or unfold."""
    import yaml

    count = 0
    around: list[tuple[str | None, int]] = []  # anchor of each open collection, and the count before it
    sizes: dict[str | None, int] = {}
    events: Any = yaml.parse(text, Loader=_loader())
    for event in events:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, before = around.pop()
            sizes[anchor] = count - before
        elif isinstance(event, yaml.NodeEvent):
            count += 1
            if isinstance(event, yaml.AliasEvent):
                if event.anchor in (anchor for anchor, _ in around):
                    raise SettingError(f"the alias *{event.anchor} in line {line} is part of what it repeats")
                count += sizes.get(event.anchor, 0)
            elif isinstance(event, yaml.CollectionStartEvent):
                around.append((event.anchor, count))
        if len(around) > MOST_LEVELS:
            raise SettingError(f"line {line} has more than {MOST_LEVELS} levels of nesting")
        if count > MOST_ENTRIES:
            raise SettingError(f"line {line} has the {MOST_ENTRIES + 1}th entry, aliases included, of {MOST_ENTRIES}")


@cache
def _loader() -> Any:
    """Return a loader of YAML without Python objects, which refuses repeated keys and numbers that YAML misreads."""
    import yaml

    class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # libyaml is fast
        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            first: dict[str, Any] = {}
            for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
                if (before := first.setdefault(key.value, key)) is not key:
                    lines = before.start_mark.line + 1, key.start_mark.line + 1
                    where = f"line {lines[1]} twice" if lines[0] == lines[1] else f"lines {lines[0]} and {lines[1]}"
                    raise SettingError(f"the key {key.value!r} is in {where}")
            return super().construct_mapping(node, deep)

    def number(loader: Any, node: Any) -> Any:
        """Compare the value with the decimal number as written: 010 is 8 for YAML 1.1, and 1:30 is 90."""
        kind = node.tag.rpartition(":")[2]
        read = getattr(loader, f"construct_yaml_{kind}")(node)
        try:
            exact = decimal_of(node.value) == decimal_of(str(read))
        except ValueError:
            exact = False
        if not exact:
            meaning = f"{node.value}, which YAML reads as the {kind} {read}"
            allowed = "numbers have decimal digits, and those with more than a double holds, as text, are in quotes"
            raise SettingError(f"line {node.start_mark.line + 1} has {meaning}: {allowed}")
        return read

    for kind in ("int", "float", "timestamp"):
        Loader.add_constructor(f"tag:yaml.org,2002:{kind}", number)
    return Loader


def checked_configs(words: Sequence[str], given: Mapping[str, Any]) -> list[str]:
    """Return the configs of a command of Snakemake, or :data:`CONFIGS` if it names none, after a check of each."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--configfile", "--configfiles", nargs="+", default=[])
    places = list(parser.parse_known_args(words)[0].configfile)
    if not places and not {"name", "integrators", "systems"} <= given.keys():
        places = CONFIGS
    try:
        for place in places:
            read_mapping(place)
    except NearharmonicError as error:
        refuse(error)
    return places


def refuse(error: NearharmonicError) -> NoReturn:
    """End with a sentence about bad input and the exit status for it; an error in a Snakefile prints its traceback."""
    sys.stderr.write(printable(f"nearharmonic: {error}\n"))
    sys.exit(2)


def warn_of_name(name: str, places: Iterable[str]) -> None:
    """Warn on standard error of a config, other than the paper's, with the name of the paper's results."""
    if name == "paper" and not any(Path(place).parts[-2:] == ("config", "config.yaml") for place in places):
        effect = "this config replaces its results in results/paper and its pages below docs"
        says = f"name = 'paper' is the name of config/config.yaml, and {effect}: rename it"
        sys.stderr.write(f"nearharmonic: warning: {says}\n")


# --- Reading of a config: types, then relations between keys; an error message names the key.


def read(place: Path) -> Config:
    """Return the config of a YAML file, with the checks of :func:`load`."""
    return load(read_mapping(place), [place])


def load(mapping: Mapping[str, Any], files: Iterable[Path | str] = ()) -> Config:
    """Return ``mapping`` as a :class:`Config`, after validation of the types and then of relations between keys.

    Systems and integrators of the config then replace a previous config's definitions in the registries. Users'
    files are searched for in the working directory, then in the folders of the config's ``files``.
    """
    folders = list(dict.fromkeys([Path(), *(Path(os.path.relpath(Path(file).parent)) for file in files)]))
    config = _typed(mapping)
    before = systems.definitions, integrators.definitions
    try:
        _define(config, folders)
        _check(config, mapping)
    except NearharmonicError:
        systems.define(before[0])
        integrators.define(before[1])
        raise
    return config


#: Texts that Python, and pydantic with it, may take for an integer.
_LIKE_AN_INTEGER = re.compile(r"[\s\d_.+-]+")


def _typed(mapping: Mapping[str, Any]) -> Config:
    """Return ``mapping`` as a config without repeated entries of lists, before relations between keys are checked."""
    from pydantic import ValidationError

    for number, (path, value) in enumerate(_members(mapping)):
        if number == MOST_ENTRIES:
            raise SettingError(f"the config has more than {MOST_ENTRIES} entries")
        # pydantic takes True for 1, None for a key not given, and digits of each script for an integer
        is_text = isinstance(value, str) and _LIKE_AN_INTEGER.fullmatch(value)
        odd = value is None or isinstance(value, bool) or is_text
        if odd and (there := _described(path)) and (not is_text or there.get("type") == "integer"):
            try:
                integer_of(value)
            except (TypeError, ValueError):
                raise bad_setting(_dotted(path), value, there["allowed"]) from None
    try:
        config = cast("Config", _adapter().validate_python(mapping))
    except ValidationError as faults:
        # A list with an invalid entry is also reported as too short.
        told = [fault for fault in faults.errors() if not (fault["type"] == "too_short" and fault["input"])]
        # An unknown or missing key is an error of its section, and one that is misspelt is unknown and missing.
        inside = {"missing", "unexpected_keyword_argument"}
        first = min(told, key=lambda fault: (len(fault["loc"]) - (fault["type"] in inside), fault["type"] == "missing"))
    else:
        _check_repetitions(config, mapping)
        return config
    path, kind = first["loc"], first["type"]
    key, section = _dotted(path), _dotted(path[:-1])
    if kind == "unexpected_keyword_argument":
        known = _described(path[:-1])["properties"]
        raise unknown_name(f"key of {section}" if section else "key of the config", path[-1], known)
    if kind == "missing":
        raise SettingError(f"{section or 'the config'} lacks the key {path[-1]!r}: {_described(path)['allowed']}")
    if kind == "literal_error":
        one_of(key, first["input"], _described(path)["enum"])  # the error has the nearest match
    raise bad_setting(key or "the config", first["input"], _described(path)["allowed"])


def _members(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Yield path and value of all members; raise an error for a key that YAML does not read as text."""
    if not isinstance(value, Mapping | list | tuple):
        return
    if len(path) == MOST_LEVELS:
        raise SettingError(f"the config has more than {MOST_LEVELS} levels of nesting, at {_dotted(path)}")
    for step, member in value.items() if isinstance(value, Mapping) else enumerate(value):
        if isinstance(value, Mapping) and not isinstance(step, str):
            raise bad_setting(f"a key of {_dotted(path) or 'the config'}", step, "a name, in quotes if need be")
        yield (*path, step), member
        yield from _members(member, (*path, step))


def _dotted(path: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


def _check_repetitions(section: Any, given: Any, here: tuple[str, ...] = ()) -> None:
    """Raise the error of the first list of settings with a repeated entry; a number of a point may occur twice."""
    members = section if isinstance(section, Mapping) else {m.name: getattr(section, m.name) for m in fields(section)}
    for name, value in members.items():
        path = (*here, name)
        if name in given and isinstance(value, tuple) and len(set(value)) < len(value) and name not in ("q0", "p0"):
            raise bad_setting(_dotted(path), given[name], _described(path)["allowed"])
        if name in given and (isinstance(value, Mapping) or is_dataclass(value)):
            _check_repetitions(value, given[name], path)


def _check(config: Config, mapping: Mapping[str, Any]) -> None:
    """Raise the first error of relations between keys, when systems and integrators are defined."""
    for key, entries in _lists_of_methods(config).items():
        with _named(key):
            names = expanded(entries)
        if len(set(names)) < len(names):
            raise bad_setting(key, list(entries), "each integrator named once")
    for sweep in config.sweeps:
        grid, here = mapping["systems"][sweep.system]["tau_per_stage"], f"systems.{sweep.system}.tau_per_stage"
        if sweep.highest < sweep.lowest:
            allowed = f"a finite number, at least lowest = {grid['lowest']}"
            raise bad_setting(f"{here}.highest", grid["highest"], allowed)
        if sweep.highest > float(sweep.t_end):
            raise bad_setting(f"{here}.highest", grid["highest"], f"a finite number, at most t_end = {sweep.t_end}")
        check_sweep(sweep, config.methods)
    methods = [integrators[name] for name in config.methods]
    for member in fields(config):
        section = getattr(config, member.name)
        if hasattr(section, "check"):
            section.check(methods, tuple(config.systems))


def _lists_of_methods(config: Config) -> dict[str, tuple[str, ...]]:
    """Return the lists of integrators in a config and its sections, by key; missing lists are omitted."""
    lists = {name: getattr(config, name) for name in ("integrators", "decomposition", "overview")}
    lists |= {f"{m.name}.integrators": getattr(getattr(config, m.name), "integrators", None) for m in fields(config)}
    return {key: entries for key, entries in lists.items() if entries is not None}


@contextmanager
def _named(key: str) -> Iterator[None]:
    """Put ``key`` before the message of an error inside."""
    try:
        yield
    except NearharmonicError as error:
        kind = UnknownNameError if isinstance(error, UnknownNameError) else SettingError
        raise kind(f"{key}: {error}") from None


# --- Systems and integrators that a config defines in addition to the registered ones, validated before any job.

#: Reserved names: of the workflow, of parameters of its functions, and of methods of Snakemake's lists of files. Names
#: of cubes and of folders of runs are reserved too.
RESERVED = {
    "substeps", "sweeps", "cube", "integrator", "integrators", "run", "runs", "settings", "shard", "sweep", "system",
    "get", "items", "keys", "values", "size", "size_files", "size_tempfiles",
    *(name for name in dir(list) if not name.startswith("_")),
}  # fmt: skip
#: Maximum length of a user's name: it is part of file names, which have at most 255 bytes.
LONGEST = 60
#: Keys of a system in a config that define a user's system.
_OWN = ("file", "system", "label", "q0", "p0", "energy", "parameters", "split")


def _define(config: Config, folders: Sequence[Path]) -> None:
    """Define the systems and integrators of a config in the registries; they replace a previous config's definitions.

    Formulas of a user's system are evaluated once, so that errors occur before any job.
    """
    from nearharmonic.engine.setup import energy_at_start, invariant_values

    own = {name: asked for name, asked in config.systems.items() if _is_own(name, asked)}
    systems.define({name: _definition(f"systems.{name}", name, asked, folders) for name, asked in own.items()})
    integrators.define(_tableaus(_lists_of_methods(config), folders))
    for name in config.systems:
        with _named(f"systems.{name}" if name in own else "systems"):
            system = systems[name]
            if name in own:
                energy_at_start(system)
                check_gradients(system)
                invariant_values(system, *system.start(float))


def _is_own(name: str, asked: SystemSettings) -> bool:
    """Return True if a config defines the system; a registered system cannot be modified.

    The figures, tables and statements of the paper concern fixed initial values and parameters, and they refer to the
    systems by name.
    """
    given = [key for key in _OWN if getattr(asked, key) is not None]
    if given and name in systems.registered:
        source = f"system: {asked.system or name}" if asked.file is None else f"file: {asked.file}"
        more = "" if given[0] in ("file", "system") else f", {given[0]}: ..."
        remedy = f"write it under another name, as own_{name}: {{{source}{more}, tau_per_stage: ...}}"
        key, value = f"systems.{name}.{given[0]}", getattr(asked, given[0])
        value = list(value) if isinstance(value, tuple) else value
        raise bad_setting(key, value, f"{name} is a registered system, taken as it is: {remedy}")
    return bool(given)


def _definition(here: str, name: str, asked: SystemSettings, folders: Sequence[Path]) -> SystemDefinition:
    check_name(here, name)
    if asked.file is not None and asked.system is not None:
        raise bad_setting(f"{here}.system", asked.system, "file is also given: give one of the two")
    if asked.file is None and asked.system is None:
        raise SettingError(f"{here} lacks file, the Python file that defines it, or system, a registered system")
    if asked.system is not None and asked.system not in systems.registered:
        with _named(f"{here}.system"):
            systems[asked.system]
    return SystemDefinition(
        file=None if asked.file is None else _place_of(f"{here}.file", asked.file, folders),
        base=asked.system,
        parameters=tuple((asked.parameters or {}).items()),
        **{key: getattr(asked, key) for key in ("label", "q0", "p0", "energy")},
    )


def check_name(key: str, name: str) -> None:
    """Raise SettingError if a user's system or integrator cannot have the ``name``, the value of ``key``."""
    files = {stem.partition("/")[0] for e in experiments().values() for stem in (*e.cubes, *e.runs)}
    is_identifier = name.isascii() and name.isidentifier() and name[0] != "_" and len(name) <= LONGEST
    if not is_identifier or keyword.iskeyword(name):
        allowed = f"a letter, then letters, digits and '_', at most {LONGEST} characters, no keyword of Python"
        raise bad_setting(key, name, allowed)
    if name in RESERVED | files:
        raise bad_setting(key, name, "the workflow uses this name itself")


def _tableaus(methods: Mapping[str, Sequence[str]], folders: Sequence[Path]) -> dict[str, TableauDefinition]:
    """Return the integrators of all files in lists of integrators."""
    defined: dict[str, TableauDefinition] = {}
    paths = ((f"{key}[{i}]", entry) for key, entries in methods.items() for i, entry in enumerate(entries))
    for here, entry in ((here, entry) for here, entry in paths if is_path(entry)):
        written, chosen = split_path(entry)
        place = _place_of(here, written, folders)
        with _named(here):
            names = load_tableaus(place)
        if chosen and chosen not in names:
            raise bad_setting(here, entry, f"{written} defines {', '.join(names)}")
        for name in names:
            check_name(here, name)
            other = defined.setdefault(name, TableauDefinition(file=place, written=written))
            if other.file != place:
                raise bad_setting(here, entry, f"{other.written} defines the integrator {name!r} as well")
    return defined


def _place_of(key: str, written: str, folders: Sequence[Path]) -> str:
    """Return the path of a user's file, ``written`` under ``key``, relative to the working directory if it is there."""
    for place in (folder / written for folder in folders):
        if is_file(place):
            inside = os.path.relpath(place)
            return str(place.absolute()) if inside.startswith(os.pardir) else inside
    looked = " or ".join(dict.fromkeys(str(folder.absolute()) for folder in folders))
    raise bad_setting(key, written, f"no such file in {looked}")


# --- JSON schema of configs, and tables in documents: keys, cubes and targets. ``python -m`` writes all of them.

#: The generated files, from the root of the project.
SCHEMA, KEYS = Path("workflow/schemas/config.schema.yaml"), Path("config/README.md")
#: Pages with generated rows of a table: the pattern of the line before the rows and of the rows.
_ROWS = {
    "docs/how_to/files.md": r"(\n\| `cubes/\{system\}\.h5` .*\n)(?:\| `cubes/\w+\.h5` .*\n)*",
    "docs/index.md": r"(\n\| `snakemake -j2` .*\n)(?:\| `snakemake -j2 (?!everything)\w+` .*\n)*",
}


@cache
def schema() -> dict[str, Any]:
    """Return the JSON schema of configs, with the additional keywords ``unit`` and ``allowed`` (the text in errors)."""
    whole = _adapter().json_schema()
    inlined: dict[str, Any] = _inlined(whole, whole.pop("$defs"))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | inlined


def _inlined(member: Any, definitions: Mapping[str, Any]) -> Any:
    """Return ``member`` of a schema with resolved references, and without titles that repeat keys."""
    if isinstance(member, list):
        return [_inlined(part, definitions) for part in member]
    if not isinstance(member, Mapping):
        return member
    whole = dict(definitions[member["$ref"].rpartition("/")[2]]) if "$ref" in member else {}
    whole |= {key: value for key, value in member.items() if key not in ("$ref", "title")}
    for option in [part for part in whole.pop("anyOf", []) if part.get("type") != "null"]:
        whole = {**option, **{key: value for key, value in whole.items() if value is not None}}
    whole.pop("title", None)
    if "properties" in whole:
        whole.setdefault("allowed", f"the keys {' and '.join(', '.join(whole['properties']).rsplit(', ', 1))}")
        whole["properties"] = {name: _inlined(part, definitions) for name, part in whole["properties"].items()}
    return {key: value if key == "properties" else _inlined(value, definitions) for key, value in whole.items()}


def _described(path: Sequence[str | int]) -> Mapping[str, Any]:
    """Return the description of ``path`` in the schema; empty if no key is allowed there."""
    there: Mapping[str, Any] = schema()
    for step in path:
        if isinstance(step, int):
            there = {**there.get("items", {}), "allowed": there.get("each")}
        else:
            there = there.get("properties", {}).get(step) or there.get("additionalProperties") or {}
    return there


def key_table(described: Mapping[str, Any]) -> str:
    """Return the keys of the schema ``described`` as a Markdown table, one line per key."""
    return "\n".join(pipes(["key", "default", "allowed", "unit", "meaning"], _key_rows(described, "")))


def _key_rows(described: Mapping[str, Any], above: str) -> Iterator[tuple[str, ...]]:
    for key, member in described.get("properties", {}).items():
        default = str(member.get("default", "")).replace("'", "")
        default = "required" if key in described.get("required", ()) else default
        yield f"`{above}{key}`", default, member["allowed"], member.get("unit", ""), member["description"]
        yield from _key_rows(member, f"{above}{key}.")
        other = member.get("additionalProperties")
        yield from _key_rows(other, f"{above}{key}.<name>.") if isinstance(other, Mapping) else ()


def cube_rows() -> str:
    """Return the cubes of all experiments as rows of a Markdown table: file, dimensions, contents."""
    cubes = {stem: words for declared in experiments().values() for stem, words in declared.cubes.items()}
    return "".join(f"| `cubes/{stem}.h5` | {' | '.join(words)} |\n" for stem, words in cubes.items())


def target_rows() -> str:
    """Return the targets of all experiments as rows of a Markdown table: command, content, time."""
    rows = ((f"`snakemake -j2 {e.target}`", e.about[0].lower() + e.about[1:], e.duration) for e in beside_the_paper())
    return "".join(f"| {command} | {about.removesuffix('.')} | {duration} |\n" for command, about, duration in rows)


def write_generated() -> None:
    """Write the schema, and the tables of keys, cubes and targets into their pages, below the working directory."""
    import yaml

    write_text(SCHEMA, yaml.safe_dump(schema(), sort_keys=False, width=110))
    before = KEYS.read_text(encoding="utf-8").partition("| key |")[0]
    write_text(KEYS, f"{before}{key_table(schema())}\n")
    for (place, pattern), rows in zip(_ROWS.items(), (cube_rows(), target_rows()), strict=True):
        text = Path(place).read_text(encoding="utf-8")
        write_text(place, re.sub(pattern, r"\1" + rows.replace("\\", r"\\"), text, count=1))


if __name__ == "__main__":
    write_generated()
