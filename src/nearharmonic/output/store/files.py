"""HDF5 files that are opened after a check of their digest and of their members, and their attributes and groups.

Anybody can seal a file. HDF5 follows links and storage out of a file, to any other file or pipe, and reads types and
sizes that this package never writes. The members are therefore checked before one of them is read.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.errors import NearharmonicError, ResultFileError, bad_setting
from nearharmonic.output.store.name import NAME_KEY, misplaced
from nearharmonic.output.store.remake import unusable
from nearharmonic.output.store.seal import FORMAT, FORMAT_KEY, complaint

#: Attributes of HDF5 dimension scales.
SCALES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}
#: Exceptions of the HDF5 library for a file that it cannot read, and of members of other types than were written.
UNREADABLE = (OSError, AttributeError, LookupError, TypeError, ValueError, RuntimeError)
#: Types of numbers in a result file, without their byte order.
NUMBERS = {"f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8"}
#: Types of attributes and of their members.
PLAIN = (str, bytes, int, float, np.integer, np.floating, np.bool_)
#: Largest number of bytes that one compressed byte stands for (https://zlib.net/zlib_tech.html).
MOST_COMPRESSED = 1032


@contextmanager
def checked(path: Any) -> Iterator[Any]:
    """Open an HDF5 file inside the block if its bytes have not changed, and it is the file of this name.

    Raises
    ------
    ResultFileError
        The file is missing, truncated, damaged, not one of this package, or a copy of another file of the results, or
        HDF5 cannot read it; the message contains the command that makes it again.
    """
    if not isinstance(path, str | os.PathLike) or not 1 <= len(os.fspath(path)) <= 4096 or "\0" in os.fspath(path):
        raise bad_setting("path", path, "the path of a result file")
    fault = complaint(Path(path))
    if fault:
        raise unusable(path, fault)
    with _opened(path) as file:
        if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
            fault = f"has another format (attribute {FORMAT_KEY} is not {FORMAT!r})"
        if fault := fault or misplaced(path, file.attrs.get(NAME_KEY)) or _foreign_in(file):
            raise unusable(path, fault)
        yield file


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[Any]:
    """Open an HDF5 file inside the block without a lock: some mounts have none, and no file is changed in place."""
    import h5py

    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as error:
        if "lock" in str(error):  # this variable overrides the argument
            message = f"{path} cannot be read: its file system has no locks. Set HDF5_USE_FILE_LOCKING=FALSE"
            raise ResultFileError(message) from error
        raise unusable(path, "cannot be read") from error
    with as_written(path, "cannot be read"), file:
        yield file


@contextmanager
def as_written(
    path: str | os.PathLike[str], complaint: str = "has other variables or settings than its job writes"
) -> Iterator[None]:
    """Convert an error about the contents of a file inside the block to a ResultFileError with this complaint."""
    try:
        yield
    except NearharmonicError:
        raise
    except UNREADABLE as error:
        raise unusable(path, complaint) from error


def foreign_in(path: str | os.PathLike[str]) -> str:
    """Return the complaint about a file with a sound seal that this package has not written; empty for any other."""
    if complaint(Path(path)):
        return ""
    try:
        with _opened(path) as file:
            return _foreign_in(file)
    except ResultFileError:
        return "is no HDF5 file of this package"


def _foreign_in(group: Any) -> str:
    """Return the complaint about the first member of a group that this package does not write; empty if there is none.

    No link out of the file is followed.
    """
    import h5py

    for name in group:
        found = ""
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            found = "is a link, which may lead out of the file"
        elif isinstance(member := group[name], h5py.Dataset):
            found = _foreign(member)
        elif not isinstance(member, h5py.Group) or group.name != "/":
            found = "is no variable"
        elif deeper := _foreign_in(member):
            return deeper
        if found:
            return f"has {group.name.rstrip('/')}/{name}, which {found}"
    return ""


def _foreign(variable: Any) -> str:
    """Return what is wrong with a variable, from its description alone; empty if nothing is."""
    import h5py

    if variable.external or variable.is_virtual:
        return "has its values in another file"
    made = variable.id.get_create_plist()
    filters = {made.get_filter(number)[0] for number in range(made.get_nfilters())}
    if not filters <= {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}:
        return "has another compression than gzip"
    text = h5py.check_string_dtype(variable.dtype)
    if variable.dtype.str[1:] not in NUMBERS and (text is None or text.length is not None):
        return f"has no numbers or texts but {variable.dtype}"
    if variable.shape is None or variable.nbytes > MOST_COMPRESSED * variable.id.get_storage_size():
        return "has fewer values than it says"
    return ""


def attributes_in(member: Any) -> dict[str, Any]:
    """Return the attributes of an open file, group or variable, without those of HDF5 and netCDF.

    Raises
    ------
    TypeError
        An attribute is neither numbers nor texts.
    """
    names = (name for name in member.attrs if not name.startswith("_") and name not in SCALES)
    named = {name: member.attrs[name] for name in names}
    for name, value in named.items():
        if not all(isinstance(one, PLAIN) for one in np.asarray(value, object).flat):
            raise TypeError(f"attribute {name} is neither numbers nor texts")
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
    with _opened(path) as file:
        return attributes_in(file)


def groups_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the groups below the root of ``path``; errors are those of :func:`checked`."""
    with checked(path) as file:
        return groups_in(file)


def groups_in(file: Any) -> tuple[str, ...]:
    """Return the names of the groups of an open file."""
    import h5py

    return tuple(name for name in file if file.get(name, getclass=True) is h5py.Group)
