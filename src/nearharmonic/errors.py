"""Exception classes and their common message format: key, given value, allowed values, nearest match."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import wraps
from typing import Any

#: Most characters of a message about bad input, of a value in it, and of the names that are allowed.
LONGEST, LONGEST_VALUE, LONGEST_NAMES = 300, 80, 120
#: Number of names in a message if there are more than fit.
NEAREST = 5


class NearharmonicError(ValueError):
    """Base class of the errors of this package.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> try:
    ...     nh.kappa("ruth", 0)
    ... except nh.NearharmonicError as error:
    ...     print(error)
    highest = 0 is not allowed: an integer >= 1, and at most 1000
    """


class InputError(NearharmonicError):
    """Bad input: key, given value, what is allowed, and the nearest match, in one line of at most :data:`LONGEST`
    characters.

    The middle of a longer message is left out.
    """

    def __init__(self, message: str) -> None:
        super().__init__(in_short(message))


class TableauError(InputError):
    """Coefficients that contradict what their tableau declares."""


class SystemDefinitionError(InputError):
    """A Hamiltonian system that contradicts its own declaration."""


class UnknownNameError(InputError, KeyError):
    """A name that no registry holds; a KeyError as well, which makes ``get`` of a mapping return its default."""

    __str__ = Exception.__str__  # KeyError would put the message in quotes


class UnknownArgumentError(InputError, TypeError):
    """A keyword that a public function does not take."""


class SettingError(InputError):
    """A setting (config key or function argument) with a value that is not allowed."""


class MissingPackageError(NearharmonicError, ImportError):
    """A ``package`` of an ``extra`` of nearharmonic that is not installed; ``purpose`` is its use, with its article."""

    def __init__(self, purpose: str, package: str, extra: str) -> None:
        super().__init__(f"{purpose} needs the package {package}: pip install 'nearharmonic[{extra}]'")


class CompiledCodeError(NearharmonicError):
    """Machine code that cannot be loaded."""


class UntrustedFileError(NearharmonicError):
    """A Python file that a result names and that the user has not allowed to run."""


class RefusedError(NearharmonicError):
    """A request that is refused because of its results: an answer, not a fault of the input."""


class ResultFileError(NearharmonicError):
    """A result file that is missing, truncated, or not of this package."""


class FileWriteError(NearharmonicError, OSError):
    """A file that cannot be written: the disk is full, the folder is read-only, or the like."""


def unknown_name(kind: str, name: object, known: Iterable[str], others: Iterable[str] = ()) -> UnknownNameError:
    """Return the error for a ``name`` that is neither in ``known`` nor in ``others``, further names of the same things.

    The message has the nearest of all names, and the names that are known.
    """
    names, given = sorted(known), str(name)[:LONGEST]
    candidates = sorted({*names, *others})
    nearest = get_close_matches(given, candidates, n=1, cutoff=0.4)
    hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
    listed = ", ".join(names)
    if len(listed) <= LONGEST_NAMES:
        return UnknownNameError(f"unknown {kind} {shown(name)}.{hint} Known: {listed}")
    some = get_close_matches(given, candidates, n=NEAREST, cutoff=0.0)
    return UnknownNameError(f"unknown {kind} {shown(name)}.{hint} Nearest of {len(names)}: {', '.join(some)}")


def bad_setting(key: str, value: object, allowed: str) -> SettingError:
    """Return the error for a ``value`` of ``key`` that is not ``allowed``."""
    return SettingError(f"{key} = {shown(value)} is not allowed: {allowed}")


def naming_arguments(function: Callable[..., Any], name: str) -> Any:
    """Return a function that answers an unknown keyword with the nearest argument of ``function`` and the list."""

    @wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        try:
            return function(*args, **given)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:  # from inside of the function
                raise
            from inspect import signature

            known = [key for key in signature(function).parameters if key != "self"]
            unknown = [key for key in given if key not in known]
            if not unknown:
                raise
            nearest = get_close_matches(unknown[0], known, n=1, cutoff=0.3)
            hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
            message = f"{name} has no argument {shown(unknown[0])}.{hint} Arguments: {', '.join(known)}"
            raise UnknownArgumentError(message) from None

    return call


def warn_caller(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line outside of this package that called it, however many functions are between."""
    above, package = 1, __name__.partition(".")[0]
    while sys._getframe(above).f_globals.get("__name__", "").partition(".")[0] == package:
        above += 1
    warnings.warn(message, category, stacklevel=above + 1)


def shown(value: object) -> str:
    """Return the text of a value for a message: on one line, and shortened."""
    try:
        text = repr(value)
    except ValueError:  # an integer with more digits than Python can write
        return f"a number of type {type(value).__name__}"
    text = in_one_line(text)  # arrays have several lines
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE // 2]}... ({len(text)} characters)"


def in_one_line(text: str) -> str:
    """Return ``text`` with a space in place of each line break and the spaces around it."""
    return " ".join(line.strip() for line in text.splitlines() if line.strip())


def in_short(text: str) -> str:
    """Return ``text`` in one line of at most :data:`LONGEST` characters, with its beginning and its end."""
    text = in_one_line(text)
    return text if len(text) <= LONGEST else f"{text[:180]} ... {text[185 - LONGEST :]}"
