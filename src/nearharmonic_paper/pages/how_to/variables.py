"""Tables of the variables and attributes of result files, for docs/how_to/files.md and docs/reference/variables.md.

Names, dimensions, units and meanings are those in the files. Meanings of attributes are declared here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.output.store import groups_of, read
from nearharmonic.systems import systems as registered

if TYPE_CHECKING:
    import xarray as xr

#: System whose units are all different, so that a unit tells its quantity.
WITH_UNITS = "kepler"
HEADER = ("variable", "dimensions", "unit", "meaning")
#: Unit and meaning of each attribute of a file.
ATTRIBUTES: Mapping[str, tuple[str, str]] = {
    "format": ("", "format of the file, `nearharmonic 2`"),
    "Conventions": ("", "version of the CF conventions"),
    "file": ("", "name of the file below `results/<name>/`"),
    "system": ("", "name of the system"),
    "system_label": ("", "name of the system in titles"),
    "integrator": ("", "name of the method, in files of one method"),
    "label": ("", "name of the method in the paper"),
    "precision": ("", "precisions of the runs in the file, `double`, `extended` or both"),
    "kernel": ("", "arithmetic, summation and roles of the runs"),
    "energy_floor": ("as the errors", "smallest energy error that rounding of V admits, for functions of numba"),
    "energy_at_start": ("`energy_unit`", "H(q0, p0) of a system of your own"),
    "energy_unit": ("", "unit of this energy"),
    "orbital_period": ("unit of t", "period of the exact Kepler orbit"),
    "q0": ("unit of q", "start of the runs: exact digits as JSON"),
    "p0": ("unit of p", "start of the runs: exact digits as JSON"),
    "parameters": ("", "parameters of the system: exact digits as JSON"),
    "tau": ("unit of t", "step size of all runs of the file"),
    "blocks": ("1", "blocks of time for the interval of the Lyapunov exponent"),
    "iterations": ("1", "iterations of the runs for panel (D) of Figure 6"),
    "surface_limit": ("1", "relative energy error at which a run has left its energy surface"),
    "compared_at": ("1", "step size per stage at which methods are compared"),
    "package_version": ("", "version of nearharmonic"),
    "numpy_version": ("", "version of numpy"),
    "numba_version": ("", "version of numba"),
    "llvmlite_version": ("", "version of llvmlite"),
    "h5py_version": ("", "version of h5py"),
    "code_digest": ("", "SHA-256 of the code that made the file"),
    "coefficients_digest": ("", "SHA-256 of the coefficients of the methods"),
    "settings": ("", "settings of the job as JSON"),
    "cpu": ("", "processor on which times were measured"),
    "cpu_count": ("1", "number of its cores"),
    "pinned_core": ("1", "core on which times of single trajectories were measured"),
    "clock": ("", "clock of the measured times and its resolution"),
    "load_average": ("1", "load of the machine before and after"),
    "measured": ("", "time of the measurement in UTC"),
    "python_version": ("", "version of Python"),
    "libraries": ("", "versions of the timed libraries"),
    "problems": ("", "problems that were timed as JSON"),
    "crystal": ("", "name of the crystal"),
    "crystal_label": ("", "name of the crystal in titles"),
    "coordinates": ("1", "number of coordinates of the crystal"),
    "period": ("unit of time", "period of the fastest phonon"),
    "melting": ("unit of energy", "k_B T at the melting point"),
    "unit_of_time_fs": ("fs", "unit of time; NaN for a model without units"),
    "source": ("", "origin of the potential"),
    "target_label": ("", "name of the target of a sampler in titles"),
    "family": ("", "stages and first operator of the methods that are searched"),
    "origin": ("", "start of the search that found the method"),
}


def page(
    page: str, runs: Sequence[str], cubes: Sequence[str], systems: Sequence[str], integrators: Sequence[str]
) -> dict[str, str]:
    """Fill the page on files from run files and cubes, each of a dimensionless system and of the one with units."""
    parts = {
        "runs": table(*map(read, runs)),
        "cube": table(*map(read, cubes)),
        "attributes": pipes(
            ("attribute", "unit", "meaning"), [(f"`{name}`", *told) for name, told in ATTRIBUTES.items()]
        ),
    }
    return {"page": filled_page(page, {name: "\n".join(["", *lines, ""]) for name, lines in parts.items()})}


def reference(page: str, files: Sequence[str], kinds: Sequence[str]) -> dict[str, str]:
    """Fill the page of all variables from one file of each kind.

    Parameters
    ----------
    page : str
        Path of the page.
    files : sequence of str
        Path of a file of each kind.
    kinds : sequence of str
        Name of each kind below the folder of results, with placeholders.

    Raises
    ------
    NearharmonicError
        A file has an attribute without a meaning.
    """
    lines: list[str] = []
    for kind, path in zip(kinds, files, strict=True):
        check_attributes(path, read(path))
        lines += ["", f"## `{kind}`", ""]
        groups = groups_of(path)
        if groups:
            names = ", ".join(f"`{name}`" for name in groups)
            lines += [f"In each of the groups {names}:", ""]
        lines += table(*(read(path, group=name) for name in groups or (None,)))
    return {"page": filled_page(page, {"variables": "\n".join([*lines, ""])})}


def check_attributes(path: str, found: xr.Dataset) -> None:
    """Raise an error if a file has an attribute that :data:`ATTRIBUTES` lacks."""
    unknown = found.attrs.keys() - ATTRIBUTES.keys()
    if unknown:
        message = f"{path} has attributes without a meaning in the table of attributes: {', '.join(sorted(unknown))}"
        raise NearharmonicError(message)


def table(*datasets: xr.Dataset) -> list[str]:
    """Return a row for each variable of at least one dataset, coordinates of dimensions first.

    Where units differ, the variable has that of a quantity of the system, and the row names the quantity.
    """
    names = sorted({str(name) for one in datasets for name in one.variables})
    places = {name: next(one for one in datasets if name in one.variables) for name in names}
    ordered = sorted(names, key=lambda name: (name not in places[name].dims, name))
    rows = []
    for name in ordered:
        variable = places[name][name]
        units = [str(one[name].attrs["units"]) for one in datasets if name in one.variables]
        dimensions = ", ".join(map(str, variable.dims)) or "none"
        rows.append((f"`{name}`", dimensions, _unit(units), _sentence(str(variable.attrs["long_name"]))))
    return pipes(HEADER, rows)


def _unit(units: Sequence[str]) -> str:
    if len(set(units)) == 1 and units[0] not in _quantities():
        return units[0]
    (found,) = {one for one in units if one in _quantities()}
    return f"unit of {_quantities()[found]}"


def _quantities() -> dict[str, str]:
    """Names of quantities by their units in the system with units."""
    given = registered[WITH_UNITS].units
    return {unit: name for name, unit in given.items() if unit != "1"}


def _sentence(text: str) -> str:
    """Return a text of a file as that of a cell: vertical bars are no separators of columns."""
    return text.replace("|", "\\|").replace("_", "\\_")
