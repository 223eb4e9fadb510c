"""Result files, the only module that opens HDF5: netCDF-4 conventions, the same bytes for the same numbers."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.atomic import replacing
from nearharmonic.output.dataset import Variable, Variables

if TYPE_CHECKING:
    import xarray as xr

#: The attribute that tells a file of ours from any other HDF5 file.
FORMAT_KEY, FORMAT = "format", "nearharmonic 1"
#: Attributes that make dimension scales of HDF5 datasets, and the name of one that is no variable.
SCALES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}
BARE_DIMENSION = b"This is a netCDF dimension but not a netCDF variable"
#: Level 1 is as small as 4 within a percent on trajectories, whose low bits are noise, and half the time.
GZIP_LEVEL = 1
#: Bytes: below this a filter costs more room (chunk index) than it saves.
WORTH_COMPRESSING = 1024
#: Bytes: HDF5 caches chunks up to this size, larger ones are unpacked again at every partial read.
LARGEST_CHUNK = 2**20


def write(
    path: str | os.PathLike[str],
    variables: Variables,
    attributes: Mapping[str, Any],
    groups: Mapping[str, Variables] | None = None,
) -> None:
    """Write ``variables`` to the root of ``path`` and each of ``groups`` to a group with dimensions of its own.

    The file appears whole or not at all. No clock time goes in.

    Parameters
    ----------
    path : path
        The file to make or to replace.
    variables : Variables
        Dimensions, values and attributes of each variable, by name; ``units`` and ``long_name`` among the attributes.
    attributes : mapping
        Attributes of the file, beside its format and conventions.
    groups : mapping of str to Variables, optional
        Variables of each group, by its name.

    Raises
    ------
    NearharmonicError
        A variable without units or long_name, or lengths that contradict a dimension.
    """
    import h5netcdf

    with replacing(path) as part, h5netcdf.File(part, "w") as file:
        file.attrs.update({FORMAT_KEY: FORMAT, "Conventions": "CF-1.11", **attributes})
        _fill(file, variables)
        for name, members in (groups or {}).items():
            _fill(file.create_group(name), members)


def _fill(group: Any, variables: Variables) -> None:
    arrays = {name: np.asarray(values) for name, (_, values, _) in variables.items()}
    sizes: dict[str, int] = {}
    for name, (dims, _, attributes) in variables.items():
        missing = {"units", "long_name"} - set(attributes)
        if missing:
            message = f"variable {name!r} has no {' and no '.join(sorted(missing))}"
            raise NearharmonicError(message)
        shape = arrays[name].shape
        if len(shape) != len(dims) or any(sizes.setdefault(d, n) != n for d, n in zip(dims, shape, strict=True)):
            message = f"variable {name!r} of shape {shape} does not fit its dimensions {dims}, of lengths {sizes}"
            raise NearharmonicError(message)
    group.dimensions = sizes
    for name, (dims, _, attributes) in variables.items():
        values = arrays[name]
        if values.dtype.kind in "UO":
            variable = group.create_variable(name, dims, dtype=_text_type())
            values = values.astype(object)
        else:
            variable = group.create_variable(name, dims, dtype=values.dtype, **_filters(values))
        variable[...] = values
        variable.attrs.update(attributes)


def _text_type() -> Any:
    import h5py

    return h5py.string_dtype()


def _filters(values: np.ndarray) -> dict[str, Any]:
    """Compression for arrays that gain by it; chunks keep the trailing axes whole."""
    if values.nbytes < WORTH_COMPRESSING:
        return {}
    row = values.nbytes // values.shape[0]
    rows = min(values.shape[0], max(1, LARGEST_CHUNK // row))
    return {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True, "chunks": (rows, *values.shape[1:])}


def write_dataset(path: str | os.PathLike[str], dataset: xr.Dataset, attributes: Mapping[str, Any]) -> None:
    """Write ``dataset`` to ``path`` as :func:`write` does, with ``attributes`` beside its own."""
    variables = {str(name): (tuple(map(str, v.dims)), v.values, v.attrs) for name, v in dataset.variables.items()}
    write(path, variables, {**dataset.attrs, **attributes})


def read(
    path: str | os.PathLike[str], group: str | None = None, dimensions: Collection[str] | None = None
) -> xr.Dataset:
    """Load the root of a file, or one of its groups, into memory; the attributes of the file come with either.

    Parameters
    ----------
    path : path
        A result file.
    group : str, optional
        Name of the group; the root by default.
    dimensions : collection of str, optional
        If given, only variables that have no other dimensions are read.

    Raises
    ------
    ResultFileError
        The file is missing, truncated or not one of ours, or lacks the group; the message holds the command that makes
        it again.
    """
    with _opened(path) as file:
        return _dataset(file, path, group, dimensions)


def _dataset(
    file: Any, path: str | os.PathLike[str], group: str | None, dimensions: Collection[str] | None
) -> xr.Dataset:
    import xarray as xr

    try:
        return xr.Dataset(_variables(file if group is None else file[group], dimensions), attrs=_attributes(file))
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise _unusable(path, "cannot be read" if group is None else f"has no readable group {group!r}") from error


def _variables(group: Any, dimensions: Collection[str] | None) -> dict[str, Variable]:
    """The variables of a file or group that have no dimensions other than ``dimensions``.

    xarray's own reader returns the same but takes 3 ms for each variable, ten times as long, and a run file has tens of
    small variables.
    """
    import h5py

    found: dict[str, Variable] = {}
    for name, member in group.items():
        if not isinstance(member, h5py.Dataset) or member.attrs.get("NAME", b"").startswith(BARE_DIMENSION):
            continue
        dims = (name,) if member.is_scale else tuple(axis[0].name.rpartition("/")[2] for axis in member.dims)
        if dimensions is None or set(dims) <= set(dimensions):
            values = np.array(member.asstr()[()], dtype=str) if member.dtype == object else member[()]
            found[name] = (dims, values, _attributes(member))
    return found


def _attributes(member: Any) -> dict[str, Any]:
    """The attributes of a file, group or variable, those of HDF5 and netCDF themselves left out."""
    named = {name: value for name, value in member.attrs.items() if not name.startswith("_") and name not in SCALES}
    # netCDF holds every number as an array; one of length 1 is the number.
    return {name: value.item() if getattr(value, "size", 0) == 1 else value for name, value in named.items()}


def read_precisions(
    paths: Iterable[str | os.PathLike[str]], dimensions: Collection[str] | None = None
) -> dict[str, list[xr.Dataset]]:
    """Load the runs in the shards ``paths``, by precision: double in a file's root, any other in the group of its name.

    Parameters
    ----------
    paths : iterable of path
        Run files.
    dimensions : collection of str, optional
        As for :func:`read`.

    Raises
    ------
    ResultFileError
        As :func:`read` does.
    """
    found: dict[str, list[xr.Dataset]] = {}
    for path in paths:
        with _opened(path) as file:
            for group in (None, *_groups(file)):
                runs = _dataset(file, path, group, dimensions)
                if runs.data_vars:
                    found.setdefault(group or "double", []).append(runs)
    return found


def attributes_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path``: its provenance.

    Raises
    ------
    ResultFileError
        The file is missing, truncated or not one of ours.
    """
    with _opened(path) as file:
        return _attributes(file)


def groups_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the groups below the root of ``path``.

    Raises
    ------
    ResultFileError
        As :func:`read` does.
    """
    with _opened(path) as file:
        return _groups(file)


def _groups(file: Any) -> tuple[str, ...]:
    import h5py

    return tuple(name for name, member in file.items() if isinstance(member, h5py.Group))


def _opened(path: str | os.PathLike[str]) -> Any:
    import h5py

    if not Path(path).is_file():
        raise _unusable(path, "does not exist")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise _unusable(path, "is truncated or no HDF5 file") from error
    if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
        file.close()
        raise _unusable(path, f"is an HDF5 file, but not one of ours (no attribute {FORMAT_KEY} = {FORMAT!r})")
    return file


def _unusable(path: str | os.PathLike[str], complaint: str) -> ResultFileError:
    return ResultFileError(f"{path} {complaint}. Make it again: {command_for(path)}")


def command_for(path: str | os.PathLike[str]) -> str:
    """The command that makes the result file ``path`` again, with the config that ``results/<name>`` is named by."""
    parts = Path(path).parts
    name = parts[parts.index("results") + 1] if "results" in parts[:-1] else "paper"
    return f"snakemake -j2{'' if name == 'paper' else f' --configfile config/{name}.yaml'} --force {path}"
