"""Arrays and lists of numbers as callers give them: the one place in which they are read."""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.errors import bad_setting
from nearharmonic.systems.definition.quantities import is_list


def array_of(key: str, values: Any) -> NDArray[Any] | None:
    """Return ``values`` as a plain array if it is an array of integers or floats, else None.

    Raises
    ------
    SettingError
        A masked entry; the message begins with ``key``.
    """
    if not hasattr(values, "__array__"):
        return None
    check_mask(key, values)
    array = np.asarray(values)
    return array if array.dtype.kind in "fiu" else None


def list_of(key: str, values: Any, allowed: str, most: int) -> list[Any]:
    """Return the entries of a list, of another iterable of numbers, or of an array, whose axes are joined.

    Entries are not checked, except for masks.

    Raises
    ------
    SettingError
        No list: a single value, text, bytes, a mapping or a set; a masked entry; or more than ``most`` entries. The
        message begins with ``key``.
    """
    if hasattr(values, "__array__"):
        check_mask(key, values)
        values = np.asarray(values).ravel()[: most + 1].tolist()
    elif not is_list(values):
        raise bad_setting(key, values, allowed)
    found = list(islice(values, most + 1))  # an iterator may be endless
    if len(found) > most:
        raise bad_setting(key, f"more than {most} entries", f"{allowed}, at most {most}")
    return found


def check_mask(key: str, values: Any) -> None:
    """Refuse an array with a masked entry, below which any number may be.

    Raises
    ------
    SettingError
        It names the first such entry.
    """
    if np.ma.is_masked(values):
        place = np.argwhere(np.ma.getmaskarray(values))[0].tolist()
        raise bad_setting(f"{key}{place or ''}", "masked", "numbers, none of them masked")
