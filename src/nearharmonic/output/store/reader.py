"""Reader of result files: xarray's own, once the digest of a file has been compared."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.output.dataset import FLAG_MEANINGS, FLAG_VALUES
from nearharmonic.output.store.remake import unusable
from nearharmonic.output.store.seal import FORMAT, FORMAT_KEY, complaint

if TYPE_CHECKING:
    import xarray as xr

#: Options of xarray's reader: numbers as they are, and not as dates or masked.
PLAIN: dict[str, Any] = {"engine": "h5netcdf", "decode_times": False, "mask_and_scale": False}


def read(path: str | os.PathLike[str], group: str | None = None) -> xr.Dataset:
    """Load the root of a file, or one of its groups, into memory; the attributes of the file come with either.

    Parameters
    ----------
    path : path
        A result file.
    group : str, optional
        Name of the group; the root by default.

    Returns
    -------
    xarray.Dataset
        As ``xarray.open_dataset(path, engine="h5netcdf", group=group)`` has it, but for variables with
        ``flag_meanings``, whose integers are words here.

    Raises
    ------
    ResultFileError
        The file is missing, truncated or not one of this package, or lacks the group; the message holds the command
        that makes it again.
    """
    import xarray as xr

    attributes = attributes_of(path)
    try:
        with xr.open_dataset(path, group=group, **PLAIN) as found:
            return _described(found.load(), attributes)
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise unusable(path, "cannot be read" if group is None else f"has no readable group {group!r}") from error


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[dict[str, xr.Dataset]]:
    """Open the runs of a file by precision: double in its root, another in the group of its name.

    Values are read when they are used.

    Parameters
    ----------
    path : path
        A run file.

    Raises
    ------
    ResultFileError
        As :func:`read` does.
    """
    import xarray as xr

    attributes = attributes_of(path)
    try:
        groups = xr.open_groups(path, **PLAIN)
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise unusable(path, "cannot be read") from error
    with ExitStack() as stack:
        for one in groups.values():
            stack.enter_context(one)
        # Without runs in double precision the root is empty.
        runs = {name.strip("/") or "double": one for name, one in groups.items() if one.data_vars}
        yield {precision: _described(one, attributes) for precision, one in runs.items()}


def _described(dataset: xr.Dataset, attributes: dict[str, Any]) -> xr.Dataset:
    return _texts(dataset).drop_encoding().assign_attrs(attributes)


def _texts(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset with words in place of flags, and with texts of fixed length, which compare quickly."""
    flags = {name: _words(v) for name, v in dataset.data_vars.items() if FLAG_VALUES in v.attrs}
    texts = {name: v.astype(str) for name, v in dataset.variables.items() if v.dtype == object}
    return dataset.assign(flags | texts) if flags or texts else dataset


def _words(flags: xr.DataArray) -> xr.DataArray:
    words = np.array(flags.attrs[FLAG_MEANINGS].split())
    place = np.searchsorted(np.atleast_1d(flags.attrs[FLAG_VALUES]), flags.values)
    named = flags.copy(data=words[place])
    del named.attrs[FLAG_VALUES]
    return named


def attributes_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path``: its provenance.

    Raises
    ------
    ResultFileError
        The file is missing, truncated or not one of this package.
    """
    with _checked(path) as file:
        named = {name: value for name, value in file.attrs.items() if not name.startswith("_")}
    # netCDF keeps every number as an array; one of length 1 is the number.
    return {name: value.item() if getattr(value, "size", 0) == 1 else value for name, value in named.items()}


def groups_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the groups below the root of ``path``.

    Raises
    ------
    ResultFileError
        As :func:`read` does.
    """
    import h5py

    with _checked(path) as file:
        return tuple(name for name in file if file.get(name, getclass=True) is h5py.Group)


def _checked(path: str | os.PathLike[str]) -> Any:
    """An HDF5 file whose bytes are those that were written."""
    import h5py

    fault = complaint(Path(path))
    if fault:
        raise unusable(path, fault)
    file = h5py.File(path, "r")
    if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
        file.close()
        raise unusable(path, f"has another format (attribute {FORMAT_KEY} is not {FORMAT!r})")
    return file
