"""Files of configs, within limits: none takes long to read, and no key occurs twice in a mapping."""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from nearharmonic.errors import NearharmonicError, SettingError, bad_setting
from nearharmonic.numerics.written import decimal_of
from nearharmonic.output.atomic import opened
from nearharmonic.output.table import printable

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
            text = _decoded(file.read(MOST_BYTES + 1))
        if os.fspath(path).endswith(".json"):
            text = text.replace("\t", " ")  # which YAML does not allow between entries
        _check_size(text)
        found = yaml.load(text, Loader=_loader())
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from None
    except OSError as error:
        raise _unreadable(path, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        raise _unreadable(path, f"byte {error.start} is no text in UTF-8") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or "it is no YAML"
        raise _unreadable(path, f"{reason} in line {mark.line + 1}" if mark is not None else reason) from None
    except ValueError as error:  # a number of thousands of digits, or a date such as 2026-13-01
        raise _unreadable(path, f"a value in it is not allowed: {str(error).partition(';')[0]}") from None
    if not isinstance(found, dict):
        raise SettingError(f"{path} is no config: a mapping of the keys of a config to values is allowed")
    if TEMPLATE in found:
        allowed = f"a config is data, and Snakemake would run Python in {path}"
        raise bad_setting(TEMPLATE, found[TEMPLATE], allowed)
    return found


def _unreadable(path: str | os.PathLike[str], reason: str) -> SettingError:
    return SettingError(f"{path} cannot be read as a config: {reason}")


def _decoded(content: bytes) -> str:
    if len(content) > MOST_BYTES:
        raise OSError(errno.EFBIG, f"it has more than {MOST_BYTES} bytes")
    return content.decode("utf-8-sig")


def _check_size(text: str) -> None:
    """Count levels and entries, with those that aliases repeat, without recursion: a text may be deep or unfold."""
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

    class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # that of libyaml is fast
        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            first: dict[str, Any] = {}
            for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
                if (before := first.setdefault(key.value, key)) is not key:
                    lines = before.start_mark.line + 1, key.start_mark.line + 1
                    where = f"line {lines[1]} twice" if lines[0] == lines[1] else f"lines {lines[0]} and {lines[1]}"
                    raise SettingError(f"the key {key.value!r} is in {where}")
            return super().construct_mapping(node, deep)

    def number(loader: Any, node: Any) -> Any:
        """Compare the value with that of the decimal digits: 010 is 8 for YAML 1.1, and 1:30 is 90."""
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
    """Return the configs of a command of Snakemake after a check of each: those that it gives, or :data:`CONFIGS`."""
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
        sys.stderr.write(
            f"nearharmonic: warning: name = 'paper' is that of config/config.yaml, and {effect}: rename it\n"
        )
