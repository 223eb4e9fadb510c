"""Whether a folder of results is what its record says: every file, and the code and coefficients that made it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.provenance import digests
from nearharmonic.output.receipts import measured
from nearharmonic.output.store import command_for
from nearharmonic.record import manifest

Entries = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, order=True, kw_only=True)
class Fault:
    """Something that is not as recorded.

    Attributes
    ----------
    file : str
        Name of the file in the folder of results.
    says : str
        What is wrong with it.
    mend : str
        The command that mends it, or what else to do.
    """

    file: str
    says: str
    mend: str

    def __str__(self) -> str:
        return f"{self.file} {self.says}. {self.mend}"


def faults(folder: Path) -> list[Fault]:
    """Compare every file of ``folder`` with the manifest, and the code and coefficients here with those recorded.

    Nothing but the manifest is read as more than bytes, so that no damage can mislead or hang the reader.

    Returns
    -------
    list of Fault
        Sorted by file; empty if all is as recorded.
    """
    try:
        entries: Entries = manifest.read(folder)["files"]
    except ResultFileError as error:
        says, _, mend = str(error).partition(". ")
        return [Fault(file=manifest.MANIFEST, says=says.removeprefix(f"{folder / manifest.MANIFEST} "), mend=mend)]
    return sorted([*_of_files(folder, entries), *_of_origins(folder, entries)])


def _of_files(folder: Path, entries: Entries) -> Iterator[Fault]:
    there = set(manifest.names_in(folder))
    for name in there - entries.keys():
        yield Fault(file=name, says="is extra: no job made it", mend="Move it elsewhere")
    for name, entry in entries.items():
        again = f"Make it again: {command_for(folder / name)}"
        if name not in there:
            yield Fault(file=name, says="is missing", mend=again)
        elif measured(folder / name)["sha256"] != entry["sha256"]:
            yield Fault(file=name, says="is damaged: its bytes are not those that its job wrote", mend=again)


def _of_origins(folder: Path, entries: Entries) -> Iterator[Fault]:
    """A fault for each function whose code, systems or methods are not here as they were for some of its files."""
    made_otherwise: dict[tuple[str, str], list[str]] = {}
    for name, entry in entries.items():
        differs = _difference(
            entry["function"], tuple(entry["systems"]), tuple(entry["integrators"]), **_recorded(entry)
        )
        if differs:
            made_otherwise.setdefault((entry["function"], differs), []).append(name)
    for (function, differs), names in made_otherwise.items():
        others = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
        says = f"was made with other {differs}{others}, by {function}"
        yield Fault(file=names[0], says=says, mend=f"Make what is out of date again: {_plain_command(folder)}")


def _recorded(entry: Mapping[str, Any]) -> dict[str, str]:
    return {what: entry[what] for what in ("code", "coefficients")}


@cache
def _difference(function: str, problems: tuple[str, ...], methods: tuple[str, ...], **recorded: str) -> str:
    """What is not as recorded, in words."""
    try:
        here = digests(function, problems, methods)
    except NearharmonicError as error:
        return f"code, of which something is not here ({error})"
    return " and ".join(what for what in recorded if here[what] != recorded[what])


def _plain_command(folder: Path) -> str:
    """The command that brings all results of ``folder`` up to date."""
    return command_for(folder / "report.html").partition(" --force")[0]


def extent(folder: Path) -> tuple[int, int]:
    """Return the number of files that the manifest of ``folder`` lists, and their bytes.

    Raises
    ------
    ResultFileError
        The manifest is missing or damaged.
    """
    sizes: Iterable[int] = [entry["size"] for entry in manifest.read(folder)["files"].values()]
    return len(list(sizes)), sum(sizes)
