"""Data for decisions: the files of one folder of results, each read once, and the methods."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.page import power_of_ten, short
from nearharmonic.output.store import read
from nearharmonic_paper.record.files.texts import Texts

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Memory", "Results", "Undecided", "label", "only", "power_of_ten", "require", "short"]


class Undecided(Exception):
    """The results lack the data of a statement; the message names them."""


def require(known: object, lacking: str) -> None:
    """Raise :class:`Undecided` with the message ``lacking`` if what is ``known`` is false or empty."""
    if not known:
        raise Undecided(lacking)


class Memory:
    """Values that are computed once."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, Any] = {}

    def kept(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return the result of ``make``, which is called at the first use of ``key``."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]


class Results(Memory):
    """A folder of results.

    Parameters
    ----------
    folder : path
        The folder ``results/<name>``.
    methods : mapping of str to Tableau, optional
        The methods of the statements, by name; by default the registered splitting methods.
    leftovers : sequence of str
        Names of files that count as missing.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        methods: Mapping[str, Tableau] | None = None,
        leftovers: Sequence[str] = (),
    ) -> None:
        super().__init__()
        self._leftovers = leftovers
        self.folder = Path(folder)
        self._texts = Texts(self.folder)
        self.methods: Mapping[str, Tableau] = plain_integrators if methods is None else methods

    def has(self, name: str) -> bool:
        """Return True if the file ``name``, relative to the folder, exists and is no leftover."""
        return name not in self._leftovers and (self.folder / name).is_file()

    def cube(self, stem: str) -> xr.Dataset:
        """Return the cube of this name, only with the methods of the statements.

        Raises
        ------
        ResultFileError
            It is missing or damaged.
        """
        cube: xr.Dataset = self.kept(("cube", stem), lambda: self._known_methods(self._read_cube(stem)))
        return cube

    def _read_cube(self, stem: str) -> xr.Dataset:
        return read(self.folder / f"cubes/{stem}.h5")

    def _known_methods(self, cube: xr.Dataset) -> xr.Dataset:
        if "integrator" not in cube.dims:
            return cube
        return cube.isel(integrator=[str(name) in self.methods for name in cube["integrator"].values])

    def rows(self, stem: str) -> list[dict[str, str]]:
        """Return the rows of the table of this name, each cell a text by the name of its column.

        Rows of other methods are omitted.

        Raises
        ------
        ResultFileError
            It is missing, has no row, or one with more or fewer cells than the header.
        """
        rows: list[dict[str, str]] = self.kept(("rows", stem), lambda: self._known_rows(stem))
        return rows

    def _known_rows(self, stem: str) -> list[dict[str, str]]:
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
        """The document ``derived/coefficients.toml``.

        Raises
        ------
        ResultFileError
            It is missing, or no TOML.
        """
        name = "derived/coefficients.toml"
        text = self._texts.read(name)
        try:
            return tomllib.loads(text)
        except ValueError as error:
            raise self._texts.unusable(name, "is no TOML") from error

    def method(self, name: str) -> Tableau:
        """Return a method by its name.

        Raises
        ------
        Undecided
            It is not among the methods.
        """
        require(name in self.methods, f"the method {name} is not among those that are looked at")
        return self.methods[name]

    def panels(self) -> dict[str, xr.Dataset]:
        """Return the panels of Figure 6, by letter."""
        from nearharmonic_paper.experiments.paper.orbits.substeps import paper_panels

        panels: dict[str, xr.Dataset] = self.kept("panels", paper_panels)
        return panels


def only(rows: Sequence[Mapping[str, str]], key: str, value: str) -> Mapping[str, str]:
    """Return the row with ``value`` under ``key``.

    Raises
    ------
    Undecided
        There is none.
    """
    found = [row for row in rows if row[key] == value]
    require(found, f"the table has no {key} {value}")
    return found[0]


def label(name: str) -> str:
    """Return the label of a method, or its name if it is not registered."""
    return integrators[name].label if name in integrators else name
