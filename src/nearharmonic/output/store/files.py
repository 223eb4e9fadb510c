"""HDF5 files that are opened after a check of their digest, and their attributes and groups."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from nearharmonic.errors import bad_setting
from nearharmonic.output.store.name import NAME_KEY, misplaced
from nearharmonic.output.store.remake import unusable
from nearharmonic.output.store.seal import FORMAT, FORMAT_KEY, complaint

#: Attributes of HDF5 dimension scales.
SCALES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}


def checked(path: Any) -> Any:
    """Open an HDF5 file after a check that its bytes have not changed, and that it is the file of this name.

    Raises
    ------
    ResultFileError
        The file is missing, truncated, damaged, not one of this package, or a copy of another file of the results; the
        message contains the command that makes it again.
    """
    import h5py

    if not isinstance(path, str | os.PathLike) or not 1 <= len(os.fspath(path)) <= 4096 or "\0" in os.fspath(path):
        raise bad_setting("path", path, "the path of a result file")
    fault = complaint(Path(path))
    if fault:
        raise unusable(path, fault)
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise unusable(path, "cannot be read") from error
    if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
        file.close()
        raise unusable(path, f"has another format (attribute {FORMAT_KEY} is not {FORMAT!r})")
    fault = misplaced(path, file.attrs.get(NAME_KEY))
    if fault:
        file.close()
        raise unusable(path, fault)
    return file


def attributes_in(member: Any) -> dict[str, Any]:
    """Return the attributes of an open file, group or variable, without those of HDF5 and netCDF."""
    named = {name: value for name, value in member.attrs.items() if not name.startswith("_") and name not in SCALES}
    # netCDF stores every number as an array; an array of length 1 is the number.
    return {name: value.item() if getattr(value, "size", 0) == 1 else value for name, value in named.items()}


def attributes_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path``, its provenance; errors are those of :func:`checked`."""
    with checked(path) as file:
        return attributes_in(file)


def claimed_attributes(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path`` without a check of its bytes, to choose among files before a reader.

    Raises
    ------
    ResultFileError
        The file is missing, or HDF5 cannot open it.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return attributes_in(file)
    except (OSError, RuntimeError) as error:
        raise unusable(path, "cannot be read") from error


def groups_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the groups below the root of ``path``; errors are those of :func:`checked`."""
    with checked(path) as file:
        return groups_in(file)


def groups_in(file: Any) -> tuple[str, ...]:
    """Return the names of the groups of an open file."""
    import h5py

    return tuple(name for name in file if file.get(name, getclass=True) is h5py.Group)
