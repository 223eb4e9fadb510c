"""Exception classes and their common message format: key, given value, allowed values, nearest match."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

#: Largest number of characters of a value in a message.
LONGEST_VALUE = 500


class NearharmonicError(ValueError):
    """Base class of the errors of this package."""


class TableauError(NearharmonicError):
    """Coefficients that contradict what their tableau declares."""


class SystemDefinitionError(NearharmonicError):
    """A Hamiltonian system that contradicts its own declaration."""


class UnknownNameError(NearharmonicError, KeyError):
    """A name that no registry holds; a KeyError as well, which makes ``get`` of a mapping return its default."""

    __str__ = Exception.__str__  # KeyError would put the message in quotes


class SettingError(NearharmonicError):
    """A setting (config key or function argument) with a value that is not allowed."""


class CompiledCodeError(NearharmonicError):
    """Machine code that cannot be loaded."""


class UntrustedFileError(NearharmonicError):
    """A Python file that a result names and that the user has not allowed to run."""


class RefusedError(NearharmonicError):
    """A request that is refused because of its results: an answer, not a fault of the input."""


class ResultFileError(NearharmonicError):
    """A result file that is missing, truncated, or not of this package."""


def unknown_name(kind: str, name: object, known: Iterable[str]) -> UnknownNameError:
    """Return the error for a ``name`` that is not in ``known``, with the nearest match and all allowed names."""
    names = sorted(known)
    nearest = get_close_matches(str(name), names, n=1, cutoff=0.4)
    hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
    return UnknownNameError(f"unknown {kind} {name!r}.{hint} Known: {', '.join(names)}")


def bad_setting(key: str, value: object, allowed: str) -> SettingError:
    """Return the error for a ``value`` of ``key`` that is not ``allowed``."""
    return SettingError(f"{key} = {shown(value)} is not allowed: {allowed}")


def shown(value: object) -> str:
    """Return the text of a value for a message: on one line, and shortened."""
    try:
        text = repr(value)
    except ValueError:  # an integer with more digits than Python can write
        return f"a number of type {type(value).__name__}"
    text = re.sub(r"\s*\n\s*", " ", text)  # arrays have several lines
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE // 2]}... ({len(text)} characters)"
