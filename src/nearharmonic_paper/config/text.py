"""Text of a config, within limits: no text takes long to read, and no key occurs twice in a mapping."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from nearharmonic.errors import SettingError
from nearharmonic.numerics.written import decimal_of
from nearharmonic.output.atomic import opened

#: Kinds of values that YAML reads from text that is no number in decimal digits: 010 is 8 for it, and 1:30 is 90.
_NUMBERS = {f"tag:yaml.org,2002:{kind}" for kind in ("int", "float", "timestamp")}
#: Most bytes of a file, entries of it with those that its aliases repeat, and levels of nesting.
MOST_BYTES, MOST_ENTRIES, MOST_LEVELS = 10**6, 10**4, 20


def read_mapping(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the keys and values of a config in YAML 1.1 or JSON.

    Raises
    ------
    SettingError
        The file is missing or is no file; it is too large, too deep, no text in UTF-8, or neither YAML nor JSON; an
        alias repeats the entry that it is a part of; a key occurs twice in a mapping: YAML would use the last one; a
        number has another value for YAML than its decimal digits have; or there is no mapping.
    """
    import yaml

    try:
        with opened(path) as file:
            read = file.read(MOST_BYTES + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        raise SettingError(f"{path} cannot be read as a config: {reason}") from None
    if len(read) > MOST_BYTES:
        raise SettingError(f"{path} cannot be read as a config: it has more than {MOST_BYTES} bytes")
    try:
        text = read.decode("utf-8-sig")
        if os.fspath(path).endswith(".json"):
            text = text.replace("\t", " ")  # which YAML does not allow between entries
        _Entries(str(path)).check(yaml.parse(text, Loader=_loader()))
        found = yaml.load(text, Loader=_loader())
    except UnicodeDecodeError as error:
        place = f"byte {error.start} is no text in UTF-8"
        raise SettingError(f"{path} cannot be read as a config: {place}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f" in line {mark.line + 1}" if mark is not None else ""
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or "it is no YAML"
        raise SettingError(f"{path} cannot be read as a config: {reason}{place}") from None
    except SettingError:
        raise
    except ValueError as error:  # a number of thousands of digits, or a date such as 2026-13-01
        reason = str(error).partition(";")[0]
        raise SettingError(f"{path} cannot be read as a config: a value in it is not allowed: {reason}") from None
    if not isinstance(found, dict):
        raise SettingError(f"{path} is no config: a mapping of the keys of a config to values is allowed")
    return found


def _loader() -> Any:
    """Return the loader of YAML without Python objects: that of libyaml, ten times as fast, where it is installed."""
    import yaml

    return getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Entries:
    """Count of the entries of a document, from its events, without recursion.

    Parameters
    ----------
    path : str
        The file, for errors.
    """

    def __init__(self, path: str) -> None:
        import yaml

        self._path = path
        self._yaml: Any = yaml.SafeLoader("")
        self._count = 0
        #: Open collections: anchor, count before them, and lines of the keys; None for those of a sequence.
        self._open: list[tuple[str | None, int, dict[str, int] | None]] = []
        #: Entries in a mapping, keys and values, of the open collections.
        self._members: list[int] = []
        self._sizes: dict[str, int] = {}

    def check(self, events: Iterator[Any]) -> None:
        """Raise SettingError for too many entries or levels, an endless alias, or a key that occurs twice."""
        import yaml

        for event in events:
            if isinstance(event, yaml.CollectionEndEvent):
                anchor, before, _ = self._open.pop()
                self._members.pop()
                if anchor is not None:
                    self._sizes[anchor] = self._count - before
            elif isinstance(event, yaml.NodeEvent):
                self._enter(event)

    def _enter(self, event: Any) -> None:
        import yaml

        line = event.start_mark.line + 1
        self._as_member(event, line)
        if isinstance(event, yaml.ScalarEvent):
            self._check_number(event, line)
        self._count += 1
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in (anchor for anchor, *_ in self._open):
                raise self._error(f"the alias *{event.anchor} in line {line} is part of what it repeats")
            self._count += self._sizes.get(str(event.anchor), 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            if len(self._open) == MOST_LEVELS:
                raise self._error(f"line {line} has more than {MOST_LEVELS} levels of nesting")
            self._open.append((event.anchor, self._count, {} if isinstance(event, yaml.MappingStartEvent) else None))
            self._members.append(0)
        if self._count > MOST_ENTRIES:
            raise self._error(f"line {line} has the {MOST_ENTRIES + 1}th entry, aliases included, of {MOST_ENTRIES}")

    def _check_number(self, event: Any, line: int) -> None:
        """Compare the value of YAML with that of the decimal digits; Snakemake reads a config with YAML alone."""
        import yaml

        kind = event.tag or self._yaml.resolve(yaml.ScalarNode, event.value, event.implicit)
        if kind not in _NUMBERS:
            return
        read = self._yaml.construct_object(yaml.ScalarNode(kind, event.value))
        try:
            exact = decimal_of(event.value) == decimal_of(str(read))
        except ValueError:
            exact = False
        if not exact:
            meaning = f"{event.value}, which YAML reads as the {kind.rpartition(':')[2]} {read}"
            allowed = "numbers have decimal digits, and those with more than a double holds, as text, are in quotes"
            raise self._error(f"line {line} has {meaning}: {allowed}")

    def _as_member(self, event: Any, line: int) -> None:
        """Count a member of the innermost collection, and compare a key with those before it."""
        if not self._open:
            return
        keys = self._open[-1][2]
        is_key, self._members[-1] = self._members[-1] % 2 == 0, self._members[-1] + 1
        key = getattr(event, "value", None)
        if keys is None or not is_key or key is None:
            return
        if key in keys:
            lines = f"lines {keys[key]} and {line}" if line != keys[key] else f"line {line} twice"
            raise self._error(f"the key {key!r} is in {lines}")
        keys[key] = line

    def _error(self, what: str) -> SettingError:
        return SettingError(f"{self._path}: {what}")
