"""Described variables, and files of them in HDF5 with netCDF-4 conventions, bitwise identical for identical numbers."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from io import BytesIO
from itertools import count, groupby
from operator import itemgetter
from pathlib import Path, PurePath
from shlex import quote
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from nearharmonic.errors import NearharmonicError, ResultFileError, bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.atomic import opened, read_text, write_bytes

if TYPE_CHECKING:
    import xarray as xr

# --- Described variables: arrays with names of dimensions, unit and meaning, from which datasets and files are made.
#
# They are plain tuples, so that computing code needs neither xarray nor HDF5.

#: Attributes of a variable of words (CF conventions, section 3.5): the words, and the integers for them in a file.
FLAG_MEANINGS, FLAG_VALUES = "flag_meanings", "flag_values"
#: Meanings of integer coordinates, if "number of the ..." does not fit.
COUNTED = {"component": "number of the coordinate"}
#: Units by which xarray makes time differences of the numbers of a file, in some versions.
DECODED = {f"{size}seconds" for size in ("", "milli", "micro", "nano")} | {"days", "hours", "minutes"}
#: Attributes of a variable: ``units`` and ``long_name`` at least.
Attributes = dict[str, str]
#: A variable as xarray accepts it: names of dimensions, values, attributes.
Variable = tuple[tuple[str, ...], Any, Attributes]
Variables = dict[str, Variable]


def described(long_name: str, units: str = "1") -> Attributes:
    """Return the attributes of a variable: its meaning, and the unit of its values, "1" if they have none.

    A plural of time stands in the singular, which is the same unit.
    """
    return {"units": units.removesuffix("s") if units in DECODED else units, "long_name": long_name}


def variable(dimensions: str | tuple[str, ...], values: Any, long_name: str, units: str = "1") -> Variable:
    """Return a variable of ``values`` with one axis per dimension; a single name stands for one dimension.

    ``long_name`` and ``units`` are as for :func:`described`.
    """
    names = (dimensions,) if isinstance(dimensions, str) else tuple(dimensions)
    return names, np.asarray(values), described(long_name, units)


def coordinate(name: str, values: Any, long_name: str, units: str = "1") -> Variables:
    """Return the coordinate ``name`` along the dimension of the same name, as a mapping of one entry."""
    return {name: variable(name, values, long_name, units)}


def bounds_coordinate() -> Variables:
    """Return the coordinate ``bound`` of the two ends of an interval."""
    return coordinate("bound", ["lower", "upper"], "end of the interval")


def method_coordinates(tableaus: Iterable[Tableau]) -> Variables:
    """Return the coordinates ``integrator`` (names) and ``label`` of methods along the dimension ``integrator``."""
    methods = list(tableaus)
    return {
        "integrator": variable("integrator", [method.name for method in methods], "integrator"),
        "label": variable("integrator", [method.label for method in methods], "name in the paper"),
    }


def counted(variables: Variables) -> Variables:
    """Return a coordinate 0, 1, 2, ... for each dimension of ``variables`` that has none."""
    sizes: dict[str, int] = {}
    for dims, values, _ in variables.values():
        sizes |= zip(dims, np.shape(values), strict=True)
    meanings = {name: COUNTED.get(name, f"number of the {name.replace('_', ' ')}") for name in sizes}
    return {n: variable(n, np.arange(size), meanings[n]) for n, size in sizes.items() if n not in variables}


def flags(dimensions: str | tuple[str, ...], words: Any, meanings: Sequence[str], long_name: str) -> Variable:
    """Return a described variable of words, each one of ``meanings``; a file stores integers with these meanings."""
    names, values, notes = variable(dimensions, words, long_name)
    return names, values, {**notes, FLAG_MEANINGS: " ".join(meanings)}


def variables_of(dataset: xr.Dataset) -> Variables:
    """Return the coordinates and the variables of a dataset as described variables."""
    return {str(name): (tuple(map(str, v.dims)), v.values, v.attrs) for name, v in dataset.variables.items()}


def double_runs(cube: xr.Dataset) -> xr.Dataset:
    """Return the runs of a cube in double, otherwise in its first precision, without the dimension ``precision``."""
    if "precision" not in cube.dims:
        return cube
    names = cube["precision"].values.tolist()
    return cube.isel(precision=names.index("double") if "double" in names else 0)


def assembled(variables: Variables, coordinates: Collection[str], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return the dataset of described variables; a ValueError says that their sizes along a dimension differ.

    ``coordinates`` are the names of auxiliary coordinates. A variable with the name of its dimension is always a
    coordinate, and a dimension without one gets the coordinate 0, 1, 2, ....
    """
    import xarray as xr

    if not any(dims == (name,) for name, (dims, _, _) in variables.items()):
        auxiliary = tuple(name for name in variables if name in coordinates)
        layout = tuple((name, one[0], np.shape(one[1]), *one[2].items()) for name, one in variables.items())
        template = _template(layout, auxiliary)
        dataset = template.copy(data={name: one[1] for name, one in variables.items() if name not in auxiliary})
        for name in auxiliary:
            dataset[name].data = np.asarray(variables[name][1])
        dataset.attrs = dict(attributes)
        return dataset
    axes = {name: one for name, one in variables.items() if name in coordinates or one[0] == (name,)}
    rest = {name: one for name, one in variables.items() if name not in axes}
    return xr.Dataset(rest, counted(variables) | axes, attributes)


@lru_cache(maxsize=64)
def _template(layout: tuple[Any, ...], auxiliary: tuple[str, ...]) -> xr.Dataset:
    """Return a dataset of zeros with the coordinates 0, 1, 2, ...; xarray takes longer to make it than a short run."""
    import xarray as xr

    zeros: Variables = {name: (dims, np.broadcast_to(0.0, shape), dict(notes)) for name, dims, shape, *notes in layout}
    axes = counted(zeros) | {name: zeros.pop(name) for name in auxiliary}
    return xr.Dataset(zeros, axes)


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Contents of one HDF5 file: variables of its root, attributes of the file, and groups of variables.

    Each group has its own dimensions. ``coordinates`` are the names of auxiliary coordinates. ``evaluations`` is the
    number of force evaluations for the file; it is written to the record of the run, not to the file.
    """

    variables: Variables
    attributes: Mapping[str, Any] = field(default_factory=dict)
    coordinates: tuple[str, ...] = ()
    groups: Mapping[str, Variables] = field(default_factory=dict)
    evaluations: int = 0


# --- Names of result files within their folder of results, which each file states: a copy under another name is found.
#
# The name of the folder of results is not part of it, so results can be renamed, copied and adopted as a whole.

#: Attribute with the name of a file: ``runs/kepler/ruth/0.h5``.
NAME_KEY = "file"
#: Folders of HDF5 files in a folder of results.
ROOMS = ("runs", "reduced", "cubes")


def name_of(path: str | os.PathLike[str]) -> str:
    """Return the name of a file in its folder of results, ``results/<name>``; empty if it stands elsewhere."""
    parts = PurePath(path).parts
    starts = (i + 2 for i, part in enumerate(parts[:-3]) if part == "results" and parts[i + 2] in ROOMS)
    start = max(starts, default=None)
    return "" if start is None else "/".join(parts[start:])


# --- Commands that make a result file again, for messages about a file that is missing or damaged.

#: Config of ``snakemake`` without ``--configfile``.
DEFAULT_CONFIG = "config/config.yaml"


def unusable(path: str | os.PathLike[str], complaint: str) -> ResultFileError:
    """Return the error about a file that cannot be used, with the command that makes it again."""
    return ResultFileError(f"{path} {complaint}. Make it again: {command_for(path)}")


def command_for(path: str | os.PathLike[str]) -> str:
    """Return the command that makes a result file again, with the config for ``results/<name>``."""
    return f"{workflow_command(path)} --force {quote(os.fspath(path))}"


def workflow_command(path: str | os.PathLike[str]) -> str:
    """Return the command that updates the results of a file, with their recorded configs, or else by their name."""
    parts = Path(path).parts
    if "results" not in parts[:-1]:
        return "snakemake -j2"
    folder = Path(*parts[: parts.index("results") + 2])
    try:
        configs = usable_configs(json.loads(read_text(folder / "manifest.json"))["configfiles"], folder)
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        configs = []
    configs = configs or [DEFAULT_CONFIG if folder.name == "paper" else f"config/{folder.name}.yaml"]
    return "snakemake -j2" + ("" if configs == [DEFAULT_CONFIG] else f" --configfile {' '.join(map(quote, configs))}")


def usable_configs(recorded: object, folder: Path) -> list[str]:
    """Return the recorded config files of the results in ``folder``; none if one of them may do harm in a command.

    A config among the results could name Python files among the results, and a name with a minus is an option.
    """
    if not isinstance(recorded, list) or not all(isinstance(one, str) for one in recorded):
        return []
    inside = folder.resolve().parent
    harmful = any(one.startswith("-") or Path(os.path.realpath(one)).is_relative_to(inside) for one in recorded)
    return [] if harmful else recorded


# --- The last line of a result file: the SHA-256 of all bytes before it.
#
# HDF5 ignores bytes after its own end of file. The digest is checked before a file is opened: with a damaged file the
# HDF5 library may crash, return wrong numbers, or never end.

#: Name and value of the attribute that identifies the result files of this package.
FORMAT_KEY, FORMAT = "format", "nearharmonic 2"
#: First bytes of any HDF5 file.
SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Beginning of the last line, before the digest and a line feed.
SEAL = b"\nnearharmonic sha256 "
SEALED = len(SEAL) + 2 * sha256().digest_size + len(b"\n")
#: Number of bytes per update of the digest.
PIECE = 2**20


def complaint(path: Path) -> str:
    """Return the reason why a file must not be opened, empty if there is none, without the HDF5 library."""
    try:
        with opened(path) as file:
            signed = file.read(len(SIGNATURE)) == SIGNATURE
            size = file.seek(0, os.SEEK_END) - SEALED
            digest = digest_of_first(file, max(0, size))
            last = file.read()
    except OSError as error:
        return "does not exist" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
    if not (signed and last.startswith(SEAL)):
        return "is truncated or no result file"
    return "" if last == _seal(digest) else "is damaged: its bytes have changed since it was written"


def digest_of_first(file: BinaryIO, size: int) -> str:
    """Return the SHA-256 of the first ``size`` bytes of a file; what follows is left to be read."""
    digest = sha256()
    file.seek(0)
    for start in range(0, size, PIECE):
        digest.update(file.read(min(PIECE, size - start)))
    return digest.hexdigest()


def sealed_digest(path: str | os.PathLike[str]) -> str:
    """Return the digest in the last line of a file, or an empty text if the file ends otherwise."""
    with opened(path) as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - SEALED))
        last = file.read()
    return last[len(SEAL) : -1].decode() if last.startswith(SEAL) and len(last) == SEALED else ""


def _seal(digest: str) -> bytes:
    return SEAL + digest.encode() + b"\n"


# --- HDF5 files that are opened after a check of their digest and of their members, and their attributes and groups.
#
# Anybody can seal a file. HDF5 follows links and storage out of a file, to any other file or pipe, and reads types and
# sizes that this package never writes. The members are therefore checked before one of them is read.

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

    A ResultFileError says that it is missing, truncated, damaged, not one of this package, or a copy of another file of
    the results, or that HDF5 cannot read it; the message contains the command that makes it again.
    """
    if not isinstance(path, str | os.PathLike) or not 1 <= len(os.fspath(path)) <= 4096 or "\0" in os.fspath(path):
        raise bad_setting("path", path, "the path of a result file")
    fault = complaint(Path(path))
    if fault:
        raise unusable(path, fault)
    with _opened(path) as file:
        if str(file.attrs.get(FORMAT_KEY)) != FORMAT:
            fault = f"has another format (attribute {FORMAT_KEY} is not {FORMAT!r})"
        elif (said := file.attrs.get(NAME_KEY)) not in {None, name_of(path) or said}:  # elsewhere any name will do
            fault = f"says it is {said}"
        if fault := fault or _foreign_in(file):
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
    """Return the fault of a variable, from its description alone; empty if it has none."""
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
    """Return the attributes of an open file, group or variable, without the ones of HDF5 and netCDF.

    A TypeError says that an attribute is neither numbers nor texts.
    """
    attributes = member.attrs
    named = {name: attributes[name] for name in attributes if not name.startswith("_") and name not in SCALES}
    for name, value in named.items():
        if not all(isinstance(one, PLAIN) for one in np.asarray(value, object).flat):
            raise TypeError(f"attribute {name} is neither numbers nor texts")
    # netCDF stores every number as an array; an array of length 1 is the number.
    return {name: value.item() if getattr(value, "size", 0) == 1 else value for name, value in named.items()}


def attributes_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path``, its provenance, with the errors of :func:`checked`."""
    with checked(path) as file:
        return attributes_in(file)


def claimed_attributes(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the attributes of the file ``path`` without a check of its bytes, to choose among files before a reader.

    A ResultFileError says that the file is missing, or that HDF5 cannot open it.
    """
    with _opened(path) as file:
        return attributes_in(file)


def groups_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the groups below the root of ``path``, with the errors of :func:`checked`."""
    with checked(path) as file:
        return _groups_in(file)


def _groups_in(file: Any) -> tuple[str, ...]:
    import h5py

    return tuple(name for name in file if file.get(name, getclass=True) is h5py.Group)


# --- Reader of result files as datasets.
#
# It opens what ``xarray.open_dataset(path, engine="h5netcdf")`` opens, in a tenth of the time, which is 3 ms for each
# variable there.


def read(path: str | os.PathLike[str], group: str | None = None, *, leave_out: Collection[str] = ()) -> xr.Dataset:
    """Load the root of a file, or one of its groups, with the attributes of the file, but variables to leave out.

    It is the dataset of ``xarray.open_dataset(path, engine="h5netcdf", group=group)``, with words in place of the
    integers of variables with ``flag_meanings``. Errors are as for :func:`checked`, and one says that the group
    is not there.
    """
    with checked(path) as file:
        if group is not None and group not in _groups_in(file):
            raise unusable(path, f"has no readable group {group!r}")
        return _dataset(attributes_in(file), file if group is None else file[group], leave_out)


def read_precisions(path: str | os.PathLike[str], *, leave_out: Collection[str] = ()) -> dict[str, xr.Dataset]:
    """Load the runs of a file by precision: double is in the root, another precision in the group of its name.

    Errors are as for :func:`read`.
    """
    with checked(path) as file:
        groups, notes = {"double": file} | {name: file[name] for name in _groups_in(file)}, attributes_in(file)
        found = {precision: _dataset(notes, group, leave_out) for precision, group in groups.items()}
    # The root of a file without runs in double precision is empty.
    return {precision: runs for precision, runs in found.items() if runs.data_vars}


def _dataset(attributes: Mapping[str, Any], group: Any, leave_out: Collection[str]) -> xr.Dataset:
    import xarray as xr

    variables = dict(_variables(group, leave_out))
    # CF conventions, section 5: this attribute names auxiliary coordinates.
    named = {name for _, _, notes in variables.values() for name in notes.pop("coordinates", "").split()}
    return xr.Dataset(variables, attrs=attributes).set_coords([name for name in variables if name in named])


def _variables(group: Any, leave_out: Collection[str]) -> Iterator[tuple[str, Variable]]:
    import h5py

    for name, member in group.items():
        if isinstance(member, h5py.Dataset) and name not in leave_out:
            dims = (name,) if member.is_scale else tuple(axis[0].name.rpartition("/")[2] for axis in member.dims)
            values = np.array(member.asstr()[()], dtype=str) if member.dtype == object else member[()]
            notes = attributes_in(member)
            if FLAG_VALUES in notes:
                place = np.searchsorted(np.atleast_1d(notes.pop(FLAG_VALUES)), values)
                values = np.array(notes[FLAG_MEANINGS].split())[place]
            yield name, (dims, values, notes)


# --- Writer of result files: atomic, and without timestamps.
#
# It writes described variables, so that integration jobs need not load xarray, which would take a third of their time.
# A file is built in memory: if the disk is full, the HDF5 library crashes at the exit of the process.

#: Level 1 compresses trajectories, whose low bits are noise, as well as level 4 within a percent, in half the time.
GZIP_LEVEL = 1
#: Bytes: below this size compression costs more (a chunk index, and the time for it) than it saves.
WORTH_COMPRESSING = 8192
#: Bytes: HDF5 caches chunks up to this size; larger chunks are decompressed again at every partial read.
LARGEST_CHUNK = 2**20
#: The bytes of one significance of many doubles, but the highest, are noise if no value has this share of a sample of
#: them. They would take nine tenths of the time of compression, and shrink by the padding of short runs at most.
NOISE, SAMPLED = 0.4, 4096
#: Header of a zlib stream (RFC 1950), and the empty last block (RFC 1951) behind blocks that end with a byte.
ZLIB_HEADER, LAST_BLOCK = b"\x78\x01", b"\x03\x00"


def write(
    path: str | os.PathLike[str], variables: Variables, attributes: Mapping[str, Any],
    groups: Mapping[str, Variables] | None = None, *, coordinates: Collection[str] = (),
) -> None:  # fmt: skip
    """Write ``variables`` to the root of a file, atomically, and each of ``groups`` to a group with its own dimensions.

    A text variable whose attributes list its possible words (``flag_meanings``) is stored as integers with
    ``flag_values`` (CF conventions, section 3.5). ``attributes`` of the file are added to its format, its
    conventions, and its name in the folder of results. ``coordinates`` are the names of auxiliary coordinates (section
    5), in the root and in groups. A variable with the name of its dimension is always a coordinate, and a dimension
    without one gets the coordinate 0, 1, 2, .... A NearharmonicError says that a variable has no units or no long_name,
    or that its lengths contradict a dimension; a FileWriteError, that the file cannot be written.
    """
    import h5py

    named = {FORMAT_KEY: FORMAT, "Conventions": "CF-1.11", **attributes, NAME_KEY: name_of(path)}
    made_by = f"version=2,hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}"
    content, numbers = BytesIO(), count()
    with h5py.File(content, "w", track_order=True) as file:  # netCDF asks for the order of creation
        _annotate(file, {key: value for key, value in named.items() if key != NAME_KEY or value})
        file.attrs["_NCProperties"] = np.bytes_(made_by)
        members = ((file.create_group(name, track_order=True), one) for name, one in (groups or {}).items())
        for group, given in ((file, variables), *members):
            _fill(group, given, [name for name in coordinates if name in given], numbers)
    content.seek(0, os.SEEK_END)
    content.write(_seal(sha256(content.getbuffer()).hexdigest()))
    # Python 3.12 and newer print an error at exit if a view that the traceback of an error keeps is not released.
    with content.getbuffer() as written:
        write_bytes(path, written)


def write_dataset(path: str | os.PathLike[str], dataset: xr.Dataset, attributes: Mapping[str, Any]) -> None:
    """Write ``dataset`` to ``path`` as :func:`write` does, with ``attributes`` besides its own."""
    auxiliary = [str(name) for name in dataset.coords if name not in dataset.dims]
    write(path, variables_of(dataset), {**dataset.attrs, **attributes}, coordinates=auxiliary)


def _fill(group: Any, given: Variables, coordinates: Collection[str], numbers: Iterator[int]) -> None:
    """Write variables with the dimensions that they need, which get the next of ``numbers`` in the file."""
    variables, made = given | counted(given), {}
    arrays = {name: np.asarray(values) for name, (_, values, _) in variables.items()}
    dimensions = {name: np.int32(next(numbers)) for name in _checked_sizes(variables, arrays)}
    for name, (dims, _, attributes) in variables.items():
        values, notes = arrays[name], dict(attributes)
        if FLAG_MEANINGS in notes:
            values, notes = _flags(name, values, notes)
        if name not in coordinates and name not in dims:
            along = [other for other in coordinates if set(variables[other][0]) <= set(dims)]
            notes |= {"coordinates": " ".join(along)} if along else {}
        made[name] = _stored(group, name, values)
        _annotate(made[name], notes)
        if dims:
            made[name].attrs["_Netcdf4Dimid"] = dimensions[dims[0]]
            made[name].attrs["_Netcdf4Coordinates"] = np.array([dimensions[dim] for dim in dims])
        if name in dims:
            made[name].make_scale(name)
    for name, (dims, _, _) in variables.items():
        for axis, dim in enumerate(() if name in dims else dims):
            made[name].dims[axis].attach_scale(made[dim])


def _annotate(member: Any, notes: Mapping[str, Any]) -> None:
    """Set the attributes of a file or a variable; netCDF has each number as an array of length 1."""
    for key, value in notes.items():
        member.attrs[key] = [value] if isinstance(value, int | float | np.number) else value


def _checked_sizes(variables: Variables, arrays: Mapping[str, np.ndarray]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    for name, (dims, _, attributes) in variables.items():
        missing = {"units", "long_name"} - set(attributes)
        if missing:
            raise NearharmonicError(f"variable {name!r} has no {' and no '.join(sorted(missing))}")
        if (kind := arrays[name].dtype).kind not in "UO" and kind.str[1:] not in NUMBERS:
            raise NearharmonicError(f"variable {name!r} has values of type {kind}, which no result file has")
        shape = arrays[name].shape
        if len(shape) != len(dims) or any(sizes.setdefault(d, n) != n for d, n in zip(dims, shape, strict=True)):
            message = f"variable {name!r} of shape {shape} does not fit its dimensions {dims}, of lengths {sizes}"
            raise NearharmonicError(message)
    return sizes


def _flags(name: str, values: np.ndarray, notes: dict[str, Any]) -> tuple[np.ndarray, dict[str, Any]]:
    """Convert words to integers."""
    words = notes[FLAG_MEANINGS].split()
    codes = np.array([words.index(word) if word in words else -1 for word in values.ravel().tolist()], np.int8)
    if (codes < 0).any():
        raise NearharmonicError(f"variable {name!r} has a value that is none of {', '.join(words)}")
    return codes.reshape(values.shape), {**notes, FLAG_VALUES: np.arange(len(words), dtype=np.int8)}


def _stored(group: Any, name: str, values: np.ndarray) -> Any:
    """Create a variable; large ones are compressed in chunks of equal size, with as many trailing axes as fit."""
    import h5py

    if values.dtype.kind in "UO":
        return group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype(), track_order=True)
    if values.nbytes < WORTH_COMPRESSING:
        return group.create_dataset(name, data=values, track_order=True)
    chunks, size = list[int](), values.itemsize
    for length in reversed(values.shape):
        pieces = -(-length // max(1, LARGEST_CHUNK // size))
        chunks.insert(0, -(-length // pieces))
        size *= length
    made = group.create_dataset(
        name, values.shape, values.dtype, chunks=tuple(chunks), compression="gzip", compression_opts=GZIP_LEVEL,
        shuffle=True, track_order=True,
    )  # fmt: skip
    for place in made.iter_chunks():
        part = values[place]
        if part.shape != made.chunks:
            part = np.pad(part, [(0, full - size) for full, size in zip(chunks, part.shape, strict=True)])
        made.id.write_direct_chunk([along.start for along in place], _compressed(part))
    return made


def _compressed(chunk: np.ndarray) -> bytes:
    """Return what the filters shuffle and gzip may write for a chunk, with noise as it is."""
    planes: Any = np.ascontiguousarray(chunk.ravel().view(np.uint8).reshape(-1, chunk.itemsize).T)
    noise = [np.bincount(one).max() < NOISE * one.size for one in planes[:, :: planes.shape[1] // SAMPLED + 1]]
    noise[-1] = False
    pieces = [ZLIB_HEADER]
    for is_noise, several in groupby(zip(noise, planes, strict=True), itemgetter(0)):
        level = 0 if is_noise and chunk.dtype.kind == "f" and planes.shape[1] > SAMPLED else GZIP_LEVEL
        packing = zlib.compressobj(level, wbits=-zlib.MAX_WBITS)
        pieces += [*(packing.compress(plane) for _, plane in several), packing.flush(zlib.Z_FULL_FLUSH)]
    return b"".join([*pieces, LAST_BLOCK, zlib.adler32(planes).to_bytes(4, "big")])
