"""Data that statements are decided on: the files of one folder of results, each read once, and the methods."""

from __future__ import annotations

import csv
import io
import os
import tomllib
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cache, cached_property
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import read
from nearharmonic.reproduction.record.files.texts import Texts

if TYPE_CHECKING:
    import xarray as xr


class Undecided(Exception):
    """The results lack what a statement is about; the message says what."""


class Results:
    """A folder of results.

    Parameters
    ----------
    folder : path
        The folder ``results/<name>``.
    methods : mapping of str to Tableau, optional
        The methods that statements are about, by name; the registered ones by default.
    """

    def __init__(self, folder: str | os.PathLike[str], methods: Mapping[str, Tableau] | None = None) -> None:
        self.folder = Path(folder)
        self._texts = Texts(self.folder)
        self.methods: Mapping[str, Tableau] = integrators if methods is None else methods
        self._cubes: dict[str, xr.Dataset] = {}
        self._rows: dict[str, list[dict[str, str]]] = {}
        self._kept: dict[Hashable, Any] = {}

    def has(self, name: str) -> bool:
        """Return True if the file ``name``, relative to the folder, exists."""
        return (self.folder / name).is_file()

    def cube(self, stem: str) -> xr.Dataset:
        """Return the cube of this name, without methods that are not looked at.

        Raises
        ------
        ResultFileError
            It is missing or damaged.
        """
        if stem not in self._cubes:
            cube = self._read_cube(stem)
            if "integrator" in cube.dims:
                cube = cube.isel(integrator=[str(name) in self.methods for name in cube["integrator"].values])
            self._cubes[stem] = cube
        return self._cubes[stem]

    def _read_cube(self, stem: str) -> xr.Dataset:
        return read(self.folder / f"cubes/{stem}.h5")

    def rows(self, stem: str) -> list[dict[str, str]]:
        """Return the rows of the table of this name, each cell a text by the name of its column.

        Rows of methods that are not looked at are left out.

        Raises
        ------
        ResultFileError
            It is missing, has no row, or one with more or fewer cells than the header.
        """
        if stem not in self._rows:
            rows = self._read_rows(stem)
            self._rows[stem] = [row for row in rows if row.get("integrator", "") in {"", *self.methods}]
        return self._rows[stem]

    def _read_rows(self, stem: str) -> list[dict[str, str]]:
        name = f"tables/{stem}.csv"
        text = self._texts.read(name)
        try:
            header, first, *rest = csv.reader(io.StringIO(text))
            return [dict(zip(header, row, strict=True)) for row in (first, *rest)]
        except (csv.Error, TypeError, ValueError) as error:
            raise self._texts.unusable(name, "holds no table") from error

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

    def kept(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what ``make`` returns, called at the first use of ``key``."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def method(self, name: str) -> Tableau:
        """Return a method by its name.

        Raises
        ------
        Undecided
            It is not among the methods.
        """
        if name not in self.methods:
            message = f"the method {name} is not among those that are looked at"
            raise Undecided(message)
        return self.methods[name]

    @cache  # noqa: B019 - there is one object for each job
    def panels(self) -> dict[str, xr.Dataset]:
        """Return the panels of Figure 6, by letter."""
        from nearharmonic.reproduction.experiments.paper.orbits.substeps import paper_panels

        return paper_panels()


def only(rows: Sequence[Mapping[str, str]], key: str, value: str) -> Mapping[str, str]:
    """Return the row with ``value`` under ``key``.

    Raises
    ------
    Undecided
        There is none.
    """
    found = [row for row in rows if row[key] == value]
    if not found:
        message = f"the table has no {key} {value}"
        raise Undecided(message)
    return found[0]


def label(name: str) -> str:
    """Return what readers call a method: its label, or its name if it is not registered."""
    return integrators[name].label if name in integrators else name


_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def short(number: float, digits: int = 3) -> str:
    """A number for a reader: ``digits`` significant ones, in words if it is not finite."""
    if not isfinite(number):
        return "beyond all bounds"
    mantissa, _, exponent = f"{number:.{digits}g}".partition("e")
    return f"{mantissa} × {power_of_ten(int(exponent))}" if exponent else mantissa


def power_of_ten(exponent: int) -> str:
    """A power of ten for a reader: 10⁻³⁰."""
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"
