"""One family of errors, and the one sentence they all speak: key, given value, what is allowed, nearest match."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

#: Characters of a value that a message repeats in full.
LONGEST_VALUE = 500


class NearharmonicError(ValueError):
    """Base of every error this package raises on purpose."""


class TableauError(NearharmonicError):
    """Coefficients that contradict what their tableau declares."""


class SystemDefinitionError(NearharmonicError):
    """A Hamiltonian system that contradicts its own declaration."""


class UnknownNameError(NearharmonicError, KeyError):
    """A name that no registry holds; a KeyError as well, which makes ``get`` of a mapping return its default."""

    __str__ = Exception.__str__  # that of KeyError puts the message in quotes


class SettingError(NearharmonicError):
    """A setting (config key or function argument) outside what is allowed."""


class CompiledCodeError(NearharmonicError):
    """Machine code that cannot be loaded."""


class RefusedError(NearharmonicError):
    """A request refused because its results are not what they ought to be: an answer, not a bad input."""


class ResultFileError(NearharmonicError):
    """A result file that is missing, truncated, or not one of ours."""


def unknown_name(kind: str, name: object, known: Iterable[str]) -> UnknownNameError:
    """The error for ``name`` which is not among ``known``: says the nearest match and lists what is allowed."""
    names = sorted(known)
    nearest = get_close_matches(str(name), names, n=1, cutoff=0.4)
    hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
    return UnknownNameError(f"unknown {kind} {name!r}.{hint} Known: {', '.join(names)}")


def bad_setting(key: str, value: object, allowed: str) -> SettingError:
    """The error for a ``value`` of ``key`` outside ``allowed``."""
    return SettingError(f"{key} = {shown(value)} is not allowed: {allowed}")


def shown(value: object) -> str:
    """Return a value as messages show it: on one line, and shortened."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return f"a number of type {type(value).__name__}"
    text = re.sub(r"\s*\n\s*", " ", text)  # arrays are written over several lines
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE // 2]}... ({len(text)} characters)"
