"""Data for decisions: the files of one folder of results, each read once, and the methods."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import read
from nearharmonic.output.table import power_of_ten, short
from nearharmonic_paper.record.manifest import Texts

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Results", "Undecided", "label", "only", "power_of_ten", "require", "short"]


Given = ParamSpec("Given")
Found = TypeVar("Found")


class Undecided(Exception):
    """The results lack the data of a statement; the message names them."""


def require(known: object, lacking: str) -> None:
    """Raise :class:`Undecided` with the message ``lacking`` if what is ``known`` is false or empty."""
    if not known:
        raise Undecided(lacking)


def once(make: Callable[Given, Found]) -> Callable[Given, Found]:
    """Return a function that keeps the values of ``make`` in its first argument, results or curves of them."""

    @wraps(make)
    def kept(*given: Given.args, **named: Given.kwargs) -> Found:
        values: dict[Any, Found] = given[0].__dict__.setdefault("kept", {})
        key = (make, *given[1:], *named.items())
        if key not in values:
            values[key] = make(*given, **named)
        return values[key]

    return kept


class Results:
    """A folder of results. A file that is missing, damaged or without rows is a ResultFileError.

    ``methods`` are those of the statements, by default the registered splitting methods. ``leftovers`` are files that
    count as missing.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        methods: Mapping[str, Tableau] | None = None,
        leftovers: Sequence[str] = (),
    ) -> None:
        self._leftovers = leftovers
        self.folder = Path(folder)
        self._texts = Texts(self.folder)
        self.methods: Mapping[str, Tableau] = plain_integrators if methods is None else methods

    def has(self, name: str) -> bool:
        """Return True if the file ``name``, relative to the folder, exists and is no leftover."""
        return name not in self._leftovers and (self.folder / name).is_file()

    @once
    def cube(self, stem: str) -> xr.Dataset:
        """Return the cube of this name, only with the methods of the statements."""
        cube = self._read_cube(stem)
        if "integrator" not in cube.dims:
            return cube
        return cube.isel(integrator=[str(name) in self.methods for name in cube["integrator"].values])

    def _read_cube(self, stem: str) -> xr.Dataset:
        return read(self.folder / f"cubes/{stem}.h5")

    @once
    def rows(self, stem: str) -> list[dict[str, str]]:
        """Return the rows of the table of this name without other methods, each cell a text by its column."""
        known = {"", *self.methods}
        return [row for row in self._read_rows(stem) if row.get("integrator", "") in known]

    def _read_rows(self, stem: str) -> list[dict[str, str]]:
        name = f"tables/{stem}.csv"
        rows = self._texts.table(name).records()
        if not rows:
            raise self._texts.unusable(name, "holds no row")
        return rows

    @cached_property
    def derived(self) -> dict[str, Any]:
        """The document ``derived/coefficients.toml``."""
        name = "derived/coefficients.toml"
        text = self._texts.read(name)
        try:
            return tomllib.loads(text)
        except ValueError as error:
            raise self._texts.unusable(name, "is no TOML") from error

    def method(self, name: str) -> Tableau:
        """Return a method by its name, if it is among the methods; raise :class:`Undecided` otherwise."""
        require(name in self.methods, f"the method {name} is not among those that are looked at")
        return self.methods[name]

    @once
    def panels(self) -> dict[str, xr.Dataset]:
        """Return the panels of Figure 6, by letter."""
        from nearharmonic_paper.experiments.paper.orbits import paper_panels

        return paper_panels()


def only(rows: Sequence[Mapping[str, str]], key: str, value: str) -> Mapping[str, str]:
    """Return the row with ``value`` under ``key``; raise :class:`Undecided` if there is none."""
    found = [row for row in rows if row[key] == value]
    require(found, f"the table has no {key} {value}")
    return found[0]


def label(name: str) -> str:
    """Return the label of a method, or its name if it is not registered."""
    return integrators[name].label if name in integrators else name
