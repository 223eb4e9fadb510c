"""Writer of result files: atomic, and without timestamps.

It writes described variables, so that integration jobs need not load xarray, which would take a third of their time.
A file is built in memory: if the disk is full, the HDF5 library crashes at the exit of the process.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import write_bytes
from nearharmonic.output.dataset import FLAG_MEANINGS, FLAG_VALUES, Variables, counted
from nearharmonic.output.store.name import NAME_KEY, name_of
from nearharmonic.output.store.seal import FORMAT, FORMAT_KEY, seal

if TYPE_CHECKING:
    import xarray as xr

#: For trajectories, whose low bits are noise, level 1 compresses as well as level 4 within a percent, in half the time.
GZIP_LEVEL = 1
#: Bytes: below this size compression costs more (a chunk index) than it saves.
WORTH_COMPRESSING = 1024
#: Bytes: HDF5 caches chunks up to this size; larger chunks are decompressed again at every partial read.
LARGEST_CHUNK = 2**20


def write(
    path: str | os.PathLike[str],
    variables: Variables,
    attributes: Mapping[str, Any],
    groups: Mapping[str, Variables] | None = None,
    *,
    coordinates: Collection[str] = (),
) -> None:
    """Write ``variables`` to the root of a file, and each of ``groups`` to a group with dimensions of its own.

    Parameters
    ----------
    path : path
        The file to create or to replace, atomically.
    variables : Variables
        Dimensions, values and attributes of each variable, by name. A text variable whose attributes list its possible
        words (``flag_meanings``) is stored as integers with ``flag_values`` (CF conventions, section 3.5).
    attributes : mapping
        Attributes of the file, besides its format, its conventions, and its name in the folder of results.
    groups : mapping of str to Variables, optional
        Variables of each group, by its name.
    coordinates : collection of str
        Names of the auxiliary coordinates, in the root and in groups (CF conventions, section 5). A variable with the
        name of its dimension is always a coordinate. A dimension without coordinate gets the coordinate 0, 1, 2, ....

    Raises
    ------
    NearharmonicError
        A variable has no units or no long_name, or its lengths contradict a dimension.
    FileWriteError
        The file cannot be written.
    """
    import h5netcdf

    named = {FORMAT_KEY: FORMAT, "Conventions": "CF-1.11", **attributes, NAME_KEY: name_of(path)}
    content = BytesIO()
    with h5netcdf.File(content, "w") as file:
        file.attrs.update({key: value for key, value in named.items() if key != NAME_KEY or value})
        for group, members in ((file, variables), *((file.create_group(n), m) for n, m in (groups or {}).items())):
            _fill(group, members, [name for name in coordinates if name in members])
    seal(content)
    # Python 3.12 and newer print an error at exit if a view that the traceback of an error keeps is not released.
    with content.getbuffer() as written:
        write_bytes(path, written)


def write_dataset(path: str | os.PathLike[str], dataset: xr.Dataset, attributes: Mapping[str, Any]) -> None:
    """Write ``dataset`` to ``path`` as :func:`write` does, with ``attributes`` besides its own."""
    variables = {str(name): (tuple(map(str, v.dims)), v.values, v.attrs) for name, v in dataset.variables.items()}
    auxiliary = [str(name) for name in dataset.coords if name not in dataset.dims]
    write(path, variables, {**dataset.attrs, **attributes}, coordinates=auxiliary)


def _fill(group: Any, given: Variables, coordinates: Collection[str]) -> None:
    import h5py

    variables = given | counted(given)
    arrays = {name: np.asarray(values) for name, (_, values, _) in variables.items()}
    group.dimensions = _checked_sizes(variables, arrays)
    for name, (dims, _, attributes) in variables.items():
        values, notes = arrays[name], dict(attributes)
        if FLAG_MEANINGS in notes:
            values, notes = _flags(name, values, notes)
        if values.dtype.kind in "UO":
            made = group.create_variable(name, dims, dtype=h5py.string_dtype())
            values = values.astype(object)
        else:
            made = group.create_variable(name, dims, dtype=values.dtype, **_filters(values))
        made[...] = values
        along = " ".join(_coordinates_of(name, dims, variables, coordinates))
        made.attrs.update({**notes, **({"coordinates": along} if along else {})})


def _checked_sizes(variables: Variables, arrays: Mapping[str, np.ndarray]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    for name, (dims, _, attributes) in variables.items():
        missing = {"units", "long_name"} - set(attributes)
        if missing:
            raise NearharmonicError(f"variable {name!r} has no {' and no '.join(sorted(missing))}")
        shape = arrays[name].shape
        if len(shape) != len(dims) or any(sizes.setdefault(d, n) != n for d, n in zip(dims, shape, strict=True)):
            message = f"variable {name!r} of shape {shape} does not fit its dimensions {dims}, of lengths {sizes}"
            raise NearharmonicError(message)
    return sizes


def _coordinates_of(
    name: str, dims: tuple[str, ...], variables: Variables, coordinates: Collection[str]
) -> Iterator[str]:
    """Yield the names of the auxiliary coordinates whose dimensions a variable has."""
    if name not in coordinates and name not in dims:
        for other in coordinates:
            if set(variables[other][0]) <= set(dims):
                yield other


def _flags(name: str, values: np.ndarray, notes: dict[str, Any]) -> tuple[np.ndarray, dict[str, Any]]:
    """Convert words to integers."""
    words = notes[FLAG_MEANINGS].split()
    codes = np.array([words.index(word) if word in words else -1 for word in values.ravel().tolist()], np.int8)
    if (codes < 0).any():
        raise NearharmonicError(f"variable {name!r} has a value that is none of {', '.join(words)}")
    return codes.reshape(values.shape), {**notes, FLAG_VALUES: np.arange(len(words), dtype=np.int8)}


def _filters(values: np.ndarray) -> dict[str, Any]:
    """Return HDF5 filters: compression for large arrays; chunks contain as many trailing axes as fit."""
    if values.nbytes < WORTH_COMPRESSING:
        return {}
    chunks: list[int] = []
    size = values.itemsize
    for length in reversed(values.shape):
        chunks.insert(0, min(length, max(1, LARGEST_CHUNK // size)))
        size *= length
    packed = {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True}
    return {"chunks": tuple(chunks), **packed}
