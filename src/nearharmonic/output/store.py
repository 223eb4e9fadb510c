"""Result files, the only module that opens HDF5: netCDF-4 conventions, the same bytes for the same numbers.

A file ends in a line with the SHA-256 of all that stands before it, which HDF5 passes over. It is compared before the
file is opened: on a damaged file the HDF5 library may fail anywhere, return other numbers, or loop for ever.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Mapping
from hashlib import file_digest, sha256
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
#: The first bytes of any HDF5 file.
SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: The last line of a file begins so; the digest and a line feed follow.
SEAL = b"\nnearharmonic sha256 "
SEALED = len(SEAL) + 2 * sha256().digest_size + len(b"\n")
#: The config of ``snakemake`` without one.
DEFAULT_CONFIG = "config/config.yaml"
#: Bytes that are hashed at a time.
PIECE = 2**20
#: Bytes: below this compression costs more room (chunk index) than it saves.
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

    with replacing(path) as part:
        with h5netcdf.File(part, "w") as file:
            file.attrs.update({FORMAT_KEY: FORMAT, "Conventions": "CF-1.11", **attributes})
            _fill(file, variables)
            for name, members in (groups or {}).items():
                _fill(file.create_group(name), members)
        with part.open("r+b") as file:
            digest = file_digest(file, "sha256").hexdigest()
            file.write(_seal(digest))


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
    for name, size in sizes.items():
        if name not in variables and size:
            # The scale that h5netcdf would make of a dimension without coordinate, but with a checksum.
            group._h5group.create_dataset(name, (size,), ">f4", track_order=True, **_checksum((size,)))
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
    """A checksum, and compression for arrays that gain by it; chunks keep the trailing axes whole."""
    if values.nbytes < WORTH_COMPRESSING:
        return _checksum(values.shape)
    row = values.nbytes // values.shape[0]
    rows = min(values.shape[0], max(1, LARGEST_CHUNK // row))
    packed = {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True}
    return {**_checksum((rows, *values.shape[1:])), **packed}


def _checksum(chunk: tuple[int, ...]) -> dict[str, Any]:
    """The checksum of HDF5 over each chunk; single numbers and empty arrays have no chunks."""
    return {"fletcher32": True, "chunks": chunk} if chunk and all(chunk) else {}


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

    complaint = _complaint(Path(path))
    if complaint:
        raise _unusable(path, complaint)
    file = h5py.File(path, "r")
    if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
        file.close()
        raise _unusable(path, f"has another format (attribute {FORMAT_KEY} is not {FORMAT!r})")
    return file


def _complaint(path: Path) -> str:
    """What keeps a file from being opened; nothing of it is read as HDF5."""
    try:
        with path.open("rb") as file:
            signed = file.read(len(SIGNATURE)) == SIGNATURE
            size = file.seek(0, os.SEEK_END) - SEALED
            if size < 0 or not signed:
                return "is truncated or no result file"
            digest = sha256()
            file.seek(0)
            for start in range(0, size, PIECE):
                digest.update(file.read(min(PIECE, size - start)))
            seal = file.read()
    except OSError as error:
        return "does not exist" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
    if not seal.startswith(SEAL):
        return "is truncated or no result file"
    return "" if seal == _seal(digest.hexdigest()) else "is damaged: its bytes are not those that were written"


def sealed_digest(path: str | os.PathLike[str]) -> str:
    """Return the digest that a file has in its last line; an empty text if it ends otherwise."""
    with Path(path).open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - SEALED))
        last = file.read()
    return last[len(SEAL) : -1].decode() if last.startswith(SEAL) and len(last) == SEALED else ""


def _seal(digest: str) -> bytes:
    return SEAL + digest.encode() + b"\n"


def _unusable(path: str | os.PathLike[str], complaint: str) -> ResultFileError:
    return ResultFileError(f"{path} {complaint}. Make it again: {command_for(path)}")


def command_for(path: str | os.PathLike[str]) -> str:
    """The command that makes the result file ``path`` again, with the config that ``results/<name>`` is named by."""
    return f"{workflow_command(path)} --force {path}"


def workflow_command(path: str | os.PathLike[str]) -> str:
    """The command that brings the results up to date among which ``path`` is, with their config."""
    parts = Path(path).parts
    if "results" not in parts[:-1]:
        return "snakemake -j2"
    end = parts.index("results") + 2
    config = _config_of(Path(*parts[:end]))
    return "snakemake -j2" if config == DEFAULT_CONFIG else f"snakemake -j2 --configfile {config}"


def _config_of(folder: Path) -> str:
    """The config file that the results in ``folder`` were made with, or else the one that their name points to."""
    guess = DEFAULT_CONFIG if folder.name == "paper" else f"config/{folder.name}.yaml"
    try:
        said = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["configfiles"]
        return " ".join(map(str, said)) or guess
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return guess
