"""Numbers and arrays of numbers as callers give them: the one place in which they are read.

Decimal strings, fractions and numbers of any precision are exact: a double and the digits below it. Floats mean their
binary value. What is no number of the system's units is refused: truth values, complex numbers, differences of times,
masked entries, and numbers that bring a unit of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.engine.numbers.rotations import pair_of
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import exact_value, is_real
from nearharmonic.systems.definition.quantities import is_list

#: Description of a valid number in errors.
NUMBER = "a finite number in the system's units: a float, or an exact decimal string or fraction"


def exact(key: str, value: object) -> Fraction:
    """Return the exact value of a number, or of a string such as "0.1", "1e-3" or "1/3".

    Raises
    ------
    SettingError
        No number, NaN, or one whose modulus no double holds.
    """
    try:
        number = exact_value(value)
        float(number)
    except (TypeError, ValueError, OverflowError):
        raise bad_setting(key, value, NUMBER) from None
    return number


def array_of(key: str, values: Any) -> NDArray[Any] | None:
    """Return ``values`` as a plain array if it is an array of integers or floats, else None.

    Raises
    ------
    SettingError
        A masked entry, or numbers with a unit of their own; the message begins with ``key``.
    """
    if hasattr(values, "magnitude") or hasattr(type(values), "unit") or hasattr(type(values), "units"):
        raise bad_setting(key, values, "numbers in the system's units, without a unit of their own")
    if not hasattr(values, "__array__"):
        return None
    if np.ma.is_masked(values):
        place = np.argwhere(np.ma.getmaskarray(values))[0].tolist()
        raise bad_setting(f"{key}{place or ''}", "masked", "numbers, none of them masked")
    array = np.asarray(values)
    return array if array.dtype.kind in "fiu" else None


def doubles_of(key: str, values: Any, allowed: str) -> Any:
    """Return an array of numbers as doubles, if these hold them exactly, or as lists; return no array unchanged.

    Raises
    ------
    SettingError
        As for :func:`array_of`, or an array of neither numbers, text nor objects.
    """
    array = array_of(key, values)
    if array is not None:
        with np.errstate(all="ignore"):
            doubles = array.astype(float)
            exactly = np.abs(doubles) < 2.0**53 if array.dtype.kind in "iu" else doubles == array
        return doubles if array.dtype == float or exactly.all() else array.tolist()
    if not hasattr(values, "__array__"):
        return values
    if np.asarray(values).dtype.kind not in "OU":
        raise bad_setting(key, values, allowed)
    return np.asarray(values).tolist()


def list_of(key: str, values: Any, allowed: str, most: int) -> list[Any]:
    """Return the entries of a list, of another iterable of numbers, or of an array of one dimension.

    Entries are not checked, except for masks and units; they keep their type.

    Raises
    ------
    SettingError
        No list: a single value, text, bytes, a mapping or a set; an array of other than one dimension; a masked entry;
        or more than ``most`` entries. The message begins with ``key``.
    """
    array_of(key, values)  # for its checks
    if hasattr(values, "__array__"):
        array = np.asarray(values)
        if array.ndim != 1:
            raise bad_setting(key, f"array of shape {array.shape}", f"{allowed}, of one dimension")
        values = array[: most + 1]
        values = values.tolist() if values.dtype == float else list(values)
    elif not is_list(values):
        raise bad_setting(key, values, allowed)
    found = list(islice(values, most + 1))  # an iterator may be endless
    if len(found) > most:
        raise bad_setting(key, f"more than {most} entries", f"{allowed}, at most {most}")
    return found


def rows_of(key: str, values: Any, width: int, allowed: str, *, several: bool = True) -> Floats:
    """Return pairs (R, width, 2) of the numbers of a row, or of several: a double, and the digits below it.

    Parameters
    ----------
    key : str
        Name of the argument.
    values : number, sequence or array of shape (width,) or (R, width)
        The numbers; a single one is a row if ``width`` is 1.
    width : int
        Numbers of a row.
    allowed : str
        Description of valid values in errors.
    several : bool
        False for one row alone.

    Raises
    ------
    SettingError
        Another shape, no row, or an entry that is masked or no finite number.
    """
    read = doubles_of(key, values, allowed)
    if isinstance(read, np.ndarray):
        array = np.atleast_1d(read)
        if array.ndim > 1 + several or array.shape[-1] != width or not len(array):
            raise bad_setting(key, f"array of shape {read.shape}", allowed)
        return _pairs_of(key, array.reshape(-1, width))
    if isinstance(read, str | Decimal) or is_real(read):
        read = [read]
    if not isinstance(read, Sequence) or not is_list(read) or not read:
        raise bad_setting(key, values, allowed)
    if several and is_list(read[0]):
        return np.concatenate([rows_of(f"{key}[{i}]", x, width, allowed, several=False) for i, x in enumerate(read)])
    if len(read) != width:
        raise bad_setting(key, values, allowed)
    if all(type(value) is float for value in read):
        return _pairs_of(key, np.array([read]))
    return np.array([[_pair(f"{key}[{i}]", value) for i, value in enumerate(read)]])


def column_of(key: str, values: Any) -> Floats:
    """Return pairs (R, 2) of one number, or of a list or an array of them.

    Raises
    ------
    SettingError
        An array that is empty or of more than one dimension, or an entry that is masked or no finite number.
    """
    read = doubles_of(key, values, NUMBER)
    if isinstance(read, np.ndarray):
        if read.ndim > 1 or not read.size:
            raise bad_setting(key, f"array of shape {read.shape}", "a number, or one a member")
        return _pairs_of(key, read.reshape(-1, 1))[:, 0]
    if isinstance(read, Sequence) and is_list(read):
        return np.array([_pair(f"{key}[{i}]", x) for i, x in enumerate(read)]).reshape(-1, 2)
    return np.array([_pair(key, read)])


def _pair(key: str, value: object) -> tuple[float, float]:
    """A double and the digits below it."""
    if type(value) is float and value - value == 0:
        return value, 0.0
    return pair_of(exact(key, value))


def _pairs_of(key: str, array: Any) -> Floats:
    pairs = np.zeros((*array.shape, 2))
    pairs[..., 0] = array
    if not np.isfinite(pairs).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(pairs))[0][:-1])
        raise bad_setting(f"{key}{list(where)}", float(array[where]), NUMBER)
    return pairs
