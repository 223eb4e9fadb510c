"""Readers of a config from a mapping or a file; an error message names the key."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast

from nearharmonic.engine.settings import one_of
from nearharmonic.errors import NearharmonicError, SettingError, bad_setting, unknown_name
from nearharmonic.integrators import expanded, integrators
from nearharmonic.numerics.written import integer_of
from nearharmonic.systems import systems
from nearharmonic_paper.config.config import NUMBERS, Config, adapter, schema, sections
from nearharmonic_paper.config.definitions import define, folders_of, named
from nearharmonic_paper.config.files import MOST_ENTRIES, MOST_LEVELS, read_mapping
from nearharmonic_paper.experiments.paper.run import check_sweep


def load(mapping: Mapping[str, Any], files: Iterable[Path | str] = ()) -> Config:
    """Return ``mapping`` as a :class:`Config`, after validation of the types and then of relations between keys.

    Systems and integrators of the config are then in the registries, in place of those of a previous config.
    """
    places = list(files)
    config = _typed(mapping)
    for key, value, allowed in _repetitions(config, mapping):
        raise bad_setting(key, value, allowed)
    before = systems.definitions, integrators.definitions
    try:
        define(config.systems, _lists_of_methods(config), folders_of(places))
        _check(config, mapping)
    except NearharmonicError:
        systems.define(before[0])
        integrators.define(before[1])
        raise
    return config


def read(place: Path) -> Config:
    """Return the config of a YAML file, with the checks of :func:`load`."""
    return load(read_mapping(place), [place])


def _lists_of_methods(config: Config) -> dict[str, tuple[str, ...]]:
    """Return the lists of integrators in a config, by key; missing lists are omitted."""
    found = {name: getattr(config, name) for name in ("integrators", "decomposition", "overview")}
    found |= {f"{key}.integrators": getattr(getattr(config, key), "integrators", None) for key in sections()}
    return {key: entries for key, entries in found.items() if entries is not None}


def _check(config: Config, mapping: Mapping[str, Any]) -> None:
    """Raise the first error of a config whose systems and integrators are defined."""
    for key, entries in _lists_of_methods(config).items():
        with named(key):
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


def _typed(mapping: Mapping[str, Any]) -> Config:
    from pydantic import ValidationError

    for number, (path, value) in enumerate(_members(mapping)):
        if number == MOST_ENTRIES:
            raise SettingError(f"the config has more than {MOST_ENTRIES} entries")
        # pydantic takes True for 1, None for a key not given, and digits of each script for an integer
        odd = isinstance(value, bool) or value is None or (isinstance(value, str) and not _is_written(value))
        if odd and (there := _described(path)) and (not isinstance(value, str) or there.get("type") == "integer"):
            raise bad_setting(_dotted(path), value, there["allowed"])
    try:
        return cast("Config", adapter().validate_python(mapping))
    except ValidationError as faults:
        # An unknown or missing key is an error of its section.
        inside = {"missing", "unexpected_keyword_argument"}
        # A list with an invalid entry is also reported as too short.
        told = [fault for fault in faults.errors() if not (fault["type"] == "too_short" and fault["input"])]
        # A misspelt key is unknown and missing: the error of the unknown key has the nearest match.
        first = min(told, key=lambda fault: (len(fault["loc"]) - (fault["type"] in inside), fault["type"] == "missing"))
        raise _error_of(first) from None


def _is_written(text: str) -> bool:
    """Return True if ``text`` is an integer."""
    try:
        integer_of(text)
    except ValueError:
        return False
    return True


def _members(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Yield path and value of all members; raise an error for a key that YAML does not read as text."""
    if isinstance(value, Mapping | list | tuple):
        if len(path) == MOST_LEVELS:
            raise SettingError(f"the config has more than {MOST_LEVELS} levels of nesting, at {_dotted(path)}")
        for step in value if isinstance(value, Mapping) else ():
            if not isinstance(step, str):
                raise bad_setting(f"a key of {_dotted(path) or 'the config'}", step, "a name, in quotes if need be")
        for step, member in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield (*path, step), member
            yield from _members(member, (*path, step))


def _error_of(fault: Mapping[str, Any]) -> Exception:
    """Convert an error of pydantic to an error of the package."""
    path = fault["loc"]
    key, above = _dotted(path), _dotted(path[:-1])
    there = _described(path)
    if fault["type"] == "unexpected_keyword_argument":
        known = _described(path[:-1])["properties"]
        return unknown_name(f"key of {above}" if above else "key of the config", path[-1], known)
    if fault["type"] == "missing":
        return SettingError(f"{above or 'the config'} lacks the key {path[-1]!r}: {there['allowed']}")
    if fault["type"] == "literal_error":
        try:
            one_of(key, fault["input"], there["enum"])
        except SettingError as error:
            return error
    return bad_setting(key or "the config", fault["input"], there["allowed"])


def _described(path: Sequence[str | int]) -> Mapping[str, Any]:
    """Return the description of ``path`` in the schema; empty if no key is allowed there."""
    there: Mapping[str, Any] = schema()
    for step in path:
        if isinstance(step, int):
            there = {**there.get("items", {}), "allowed": there.get("each")}
        else:
            there = there.get("properties", {}).get(step) or there.get("additionalProperties") or {}
    return there


def _dotted(path: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


def _repetitions(section: Any, given: Any, here: tuple[str, ...] = ()) -> Iterator[tuple[str, object, str]]:
    """Yield key, value and allowed values of each list of settings with a repeated entry."""
    members = section if isinstance(section, Mapping) else {m.name: getattr(section, m.name) for m in fields(section)}
    for name, value in members.items():
        if name not in given:
            continue
        if isinstance(value, tuple) and len(set(value)) < len(value) and name not in NUMBERS:
            yield _dotted((*here, name)), given[name], _described((*here, name))["allowed"]
        elif isinstance(value, Mapping) or is_dataclass(value):
            yield from _repetitions(value, given[name], (*here, name))
