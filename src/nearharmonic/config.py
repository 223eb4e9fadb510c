"""A config, from YAML to checked settings; ``python -m nearharmonic.config`` prints the table of its keys."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, UnknownNameError, bad_setting, unknown_name
from nearharmonic.integrators import integrators
from nearharmonic.plan import check_sweep
from nearharmonic.settings import Config, Sweep, checked_t_end, checked_tau, one_of
from nearharmonic.systems import systems

SCHEMA = Path("workflow/schemas/config.schema.yaml")

Schema = Mapping[str, Any]


def read_schema(path: Path = SCHEMA) -> Schema:
    """The JSON schema of configs, kept as YAML."""
    import yaml

    schema: Schema = yaml.safe_load(path.read_text(encoding="utf-8"))
    return schema


def load(mapping: Mapping[str, Any], schema: Schema) -> Config:
    """``mapping`` as a :class:`~nearharmonic.settings.Config`: against ``schema``, then what no schema can tell.

    Defaults are filled in: those of the schema, the systems' own t_end, and all integrators for the decomposition.

    Raises:
        NearharmonicError: the first fault found, with key, value, what is allowed and the nearest match.
    """
    _check_schema(mapping, schema)
    settings = with_defaults(mapping, schema)
    methods = _known(settings, "integrators", integrators.__getitem__)
    sweeps = tuple(_sweep(name, settings) for name in _known(settings, "systems", systems.__getitem__))
    for sweep in sweeps:
        check_sweep(sweep, methods)
    decomposition = (
        _known(settings, "decomposition", integrators.__getitem__) if "decomposition" in settings else methods
    )
    return Config(name=settings["name"], integrators=methods, sweeps=sweeps, decomposition=decomposition)


def with_defaults(value: Any, schema: Schema) -> Any:
    """``value`` with the defaults of ``schema`` where a key is not given, at every depth."""
    if not isinstance(value, Mapping):
        return value
    known, other = schema.get("properties", {}), schema.get("additionalProperties") or {}
    filled = {key: member["default"] for key, member in known.items() if "default" in member} | dict(value)
    return {key: with_defaults(member, known.get(key, other)) for key, member in filled.items()}


def _known(settings: Mapping[str, Any], key: str, look_up: Callable[[str], Any]) -> tuple[str, ...]:
    """The names under ``key``, each of which ``look_up`` finds."""
    for name in settings[key]:
        try:
            look_up(name)
        except UnknownNameError as error:
            message = f"{key}: {error}"
            raise UnknownNameError(message) from None
    return tuple(settings[key])


def _sweep(name: str, settings: Mapping[str, Any]) -> Sweep:
    asked = settings["systems"][name]
    here, grid = f"systems.{name}", asked["tau_per_stage"]
    lowest = checked_tau(grid["lowest"], f"{here}.tau_per_stage.lowest")
    highest = checked_tau(grid["highest"], f"{here}.tau_per_stage.highest")
    if highest < lowest:
        key = f"{here}.tau_per_stage.highest"
        raise bad_setting(key, grid["highest"], f"a finite number, at least lowest = {grid['lowest']}")
    return Sweep(
        system=name,
        t_end=checked_t_end(asked.get("t_end", systems[name].t_end), f"{here}.t_end"),
        lowest=lowest,
        highest=highest,
        points_per_decade=grid["points_per_decade"],
        precision=tuple(asked["precision"]),
        summation=settings["summation"],
        samples=settings["samples"],
        shards=settings["shards"],
    )


def _check_schema(mapping: Mapping[str, Any], schema: Schema) -> None:
    """Raise the fault of ``mapping`` that lies nearest to its top, in the words of the package."""
    from jsonschema import Draft202012Validator

    faults = sorted(Draft202012Validator(schema).iter_errors(mapping), key=lambda fault: len(fault.absolute_path))
    if not faults:
        return
    fault = faults[0]
    key = _dotted(fault.absolute_path)
    if fault.validator == "additionalProperties":
        known = fault.schema["properties"]
        stray = next(name for name in fault.instance if name not in known)
        raise unknown_name(f"key of {key}" if key else "key of the config", stray, known)
    if fault.validator == "required":
        missing = next(name for name in fault.validator_value if name not in fault.instance)
        message = f"{key or 'the config'} lacks the key {missing!r}: {fault.schema['properties'][missing]['allowed']}"
        raise SettingError(message)
    if fault.validator == "enum":
        one_of(key, fault.instance, fault.validator_value)
    raise bad_setting(key or "the config", fault.instance, fault.schema.get("allowed", "a mapping of keys"))


def _dotted(path: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


def key_table(schema: Schema) -> str:
    """The keys of ``schema`` as a Markdown table, one line a key."""
    lines = ["| key | default | allowed | unit | meaning |", "|---|---|---|---|---|"]
    for key, member, required in _keys(schema, ""):
        default = "required" if required else str(member.get("default", "")).replace("'", "")
        cells = (f"`{key}`", default, member["allowed"], member.get("unit", ""), member["description"])
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _keys(schema: Schema, above: str) -> Iterable[tuple[str, Schema, bool]]:
    for key, member in schema.get("properties", {}).items():
        yield above + key, member, key in schema.get("required", ())
        yield from _keys(member, f"{above}{key}.")
    other = schema.get("additionalProperties")
    if isinstance(other, Mapping):
        yield from _keys(other, f"{above}<name>.")


if __name__ == "__main__":
    sys.stdout.write(key_table(read_schema()) + "\n")
