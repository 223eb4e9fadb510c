"""Comparison of two results: claims, provenance, and all numbers of cubes and tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nearharmonic.output import store
from nearharmonic_paper.record.compare.differences import Difference, dataset_differences, missing
from nearharmonic_paper.record.compare.tables import table_differences
from nearharmonic_paper.record.files import manifest
from nearharmonic_paper.record.files.texts import Texts
from nearharmonic_paper.record.history import flattened, newest_finished
from nearharmonic_paper.record.query.run_table import settings_of
from nearharmonic_paper.tasks.receipts import WHOLE

Attributes = Mapping[str, Any]

CLAIMS = Path("tables/claims.json")
#: Digits of a digest that are shown.
DIGEST = 10
#: Kinds of differences that concern the provenance of the results, not their content.
ORIGIN = ("setting", "code", "coefficients", "version")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Differences between two results.

    Attributes
    ----------
    differences : tuple of Difference
        Claims with different verdicts first, then the provenance, then cubes and tables.
    left_out : tuple of str
        Files and variables that hold measured times and are not compared.
    """

    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """True if nothing differs."""
        return not self.differences

    @property
    def same_numbers(self) -> bool:
        """True if only the provenance of the results differs."""
        return all(difference.kind in ORIGIN for difference in self.differences)


def compared(a: Path, b: Path) -> Comparison:
    """Compare two folders of results, of any configs.

    Raises
    ------
    ResultFileError
        A file that cannot be read.
    """
    pair = _Pair(a, b)
    parts = (pair.claims(), pair.settings(), pair.origins(), pair.cubes(), pair.tables())
    differences = [difference for part in parts for difference in part]
    return Comparison(differences=tuple(differences), left_out=tuple(dict.fromkeys(pair.left_out)))


class _Pair:
    """Two folders of results."""

    def __init__(self, a: Path, b: Path) -> None:
        self._folders = (a, b)
        self._newest = [newest_finished(folder) or {} for folder in self._folders]
        self._manifests = [
            manifest.read(folder) if (folder / "manifest.json").exists() else {} for folder in self._folders
        ]
        self.left_out: list[str] = []

    def claims(self) -> Iterator[Difference]:
        """Yield claims with different verdicts, and claims that only one result has."""
        one, other = map(_claims, self._folders)
        if one is None or other is None:
            if one is not other:
                yield missing(str(CLAIMS), in_a=one is not None)
            return
        for found in _differing("claim", [one, other]):
            if found.a is not None and found.b is not None:
                yield found
        for name in sorted({*one} ^ {*other}):
            yield missing(f"claim {name}", in_a=name in one)

    def settings(self) -> Iterator[Difference]:
        """Yield the differing keys of the configs, then of the settings of each cube."""
        if all(self._newest):
            configs = [dict(flattened(run.get("config", {}))) for run in self._newest]
            for config in configs:
                config.pop("name", None)  # that of the folder
            yield from _differing("setting", configs, "config: {}")
        for name, attributes in self._attributes():
            places = [folder / name for folder in self._folders]
            told = [dict(flattened(settings_of(*one))) for one in zip(places, attributes, strict=True)]
            yield from _differing("setting", told, f"{name}: {{}}")

    def origins(self) -> Iterator[Difference]:
        """Yield differing digests of code and coefficients, and versions: of the newest runs, then of the cubes."""
        cubes = list(self._attributes())
        for kind in ("code", "coefficients"):
            key = f"{kind}_digest"
            if all(self._newest):
                yield from _differing(kind, [{"newest run": run.get(key)} for run in self._newest], show=_short_digest)
            for name, attributes in cubes:
                yield from _differing(kind, [{name: told.get(key)} for told in attributes], show=_short_digest)
        yield from _differing("version", [self._versions(i, [both[i] for _, both in cubes]) for i in (0, 1)])

    def _versions(self, i: int, cubes: Iterable[Attributes]) -> dict[str, Any]:
        """Return the versions of one result, from the attributes of ``cubes`` and its newest run."""
        found: dict[str, Any] = {}
        for attributes in cubes:
            found |= {k.removesuffix("_version"): v for k, v in attributes.items() if k.endswith("_version")}
        if "package" in found:
            found["nearharmonic"] = found.pop("package")
        return found | (self._newest[i].get("versions", {}) if all(self._newest) else {})

    def _attributes(self) -> Iterator[tuple[str, list[Attributes]]]:
        """Return the name of each common cube, and its attributes in both results."""
        for name in self._names("cubes/*.h5"):
            paths = [folder / name for folder in self._folders]
            if all(path.exists() for path in paths):
                yield name, [{key: str(one) for key, one in store.attributes_of(path).items()} for path in paths]

    def _names(self, pattern: str) -> list[str]:
        return sorted(
            {path.relative_to(folder).as_posix() for folder in self._folders for path in folder.glob(pattern)}
        )

    def cubes(self) -> Iterator[Difference]:
        """Yield the differences in the cubes, including missing cubes."""
        return self._files("cubes/*.h5", self._cube)

    def _cube(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        one, other = [folder / name for folder in self._folders]
        groups = [store.groups_of(path) for path in (one, other)]
        for group in dict.fromkeys([None, *groups[0], *groups[1]]):
            place = name if group is None else f"{name}/{group}"
            if group is not None and not all(group in names for names in groups):
                yield missing(place, in_a=group in groups[0])
                continue
            datasets = store.read(one, group), store.read(other, group)
            measured = {str(v) for d in datasets for v in d.variables if "volatile" in d[v].attrs} | volatile
            self.left_out += [f"{place}: {v}" for v in sorted(measured) if any(v in d for d in datasets)]
            yield from dataset_differences(place, *datasets, measured)

    def tables(self) -> Iterator[Difference]:
        """Yield the differences in the tables, including missing tables."""
        return self._files("tables/*.csv", self._table)

    def _table(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        self.left_out += [f"{name}: {column}" for column in sorted(volatile)]
        shown_above = {"verdict"} if name == str(CLAIMS.with_suffix(".csv")) else set()
        one, other = map(Texts, self._folders)
        return table_differences(name, one, other, volatile | shown_above)

    def _files(
        self, pattern: str, differences: Callable[[str, set[str]], Iterator[Difference]]
    ) -> Iterator[Difference]:
        """Yield the differences of each common file, from its name and volatile parts, and each missing file."""
        for name in self._names(pattern):
            there = [(folder / name).exists() for folder in self._folders]
            entries = [told.get("files", {}).get(name, {}) for told in self._manifests]
            volatile = {part for entry in entries for part in entry.get("volatile", ())}
            if not all(there):
                yield missing(name, in_a=there[0])
            elif WHOLE in volatile:
                self.left_out.append(name)
            else:
                yield from differences(name, volatile)


def _claims(folder: Path) -> dict[str, str] | None:
    """Return the verdict of each claim by its id; None if there are no claims."""
    if not (folder / CLAIMS).exists():
        return None
    texts = Texts(folder)
    text = texts.read(str(CLAIMS))
    try:
        return {str(claim["id"]): str(claim["verdict"]) for claim in json.loads(text)}
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise texts.unusable(str(CLAIMS), "holds no claims") from error


def _differing(
    kind: str, both: Sequence[Mapping[str, Any]], where: str = "{}", show: Callable[[Any], Any] = lambda value: value
) -> Iterator[Difference]:
    """Yield the keys with different values, in the order of the first result; None marks a missing key."""
    one, other = both
    for key in dict.fromkeys([*one, *other]):
        if one.get(key) != other.get(key):
            yield Difference(kind=kind, where=where.format(key), a=show(one.get(key)), b=show(other.get(key)))


def _short_digest(digest: Any) -> Any:
    return digest[:DIGEST] if isinstance(digest, str) else digest
