"""Comparison of two results: claims, provenance, and all numbers of cubes and tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nearharmonic.output import store
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.differences import Difference, dataset_differences, missing, table_differences
from nearharmonic_paper.record.history import flattened, newest_finished
from nearharmonic_paper.record.manifest import Texts
from nearharmonic_paper.record.query import settings_of
from nearharmonic_paper.tasks.receipts import WHOLE

CLAIMS = Path("tables/claims.json")
#: Kinds of differences that concern the provenance of the results, not their content.
ORIGIN = ("setting", "code", "coefficients", "version")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Differences between two results: claims first, then the provenance, then cubes and tables.

    ``left_out`` are files and variables that hold measured times and are not compared.
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
    """Compare two folders of results, of any configs; a file that cannot be read is a ResultFileError."""
    pair = _Pair(a, b)
    parts = (
        pair.claims(),
        pair.settings(),
        pair.origins(),
        pair.files("cubes/*.h5", pair.cube),
        pair.files("tables/*.csv", pair.table),
    )
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
        for found in _keys_that_differ("claim", [one, other]):
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
            yield from _keys_that_differ("setting", configs, "config: {}")
        for name, attributes in self._attributes():
            places = [folder / name for folder in self._folders]
            told = [dict(flattened(settings_of(*one))) for one in zip(places, attributes, strict=True)]
            yield from _keys_that_differ("setting", told, f"{name}: {{}}")

    def origins(self) -> Iterator[Difference]:
        """Yield differing digests of code and coefficients, and versions: of the newest runs, then of the cubes."""
        cubes = list(self._attributes())
        for kind in ("code", "coefficients"):
            key = f"{kind}_digest"
            if all(self._newest):
                yield from _keys_that_differ(
                    kind, [{"newest run": run.get(key)} for run in self._newest], show=_short_digest
                )
            for name, attributes in cubes:
                yield from _keys_that_differ(kind, [{name: told.get(key)} for told in attributes], show=_short_digest)
        versions: list[dict[str, Any]] = [{}, {}]
        for told, found in ((told, versions[i]) for _, both in cubes for i, told in enumerate(both)):
            names = (key.removesuffix("_version") for key in told if key.endswith("_version"))
            found |= {name: told[f"{name}_version"] for name in names}
        for found in versions:
            if "package" in found:
                found["nearharmonic"] = found.pop("package")
        if all(self._newest):
            versions = [found | run.get("versions", {}) for found, run in zip(versions, self._newest, strict=True)]
        yield from _keys_that_differ("version", versions)

    def _attributes(self) -> Iterator[tuple[str, list[dict[str, str]]]]:
        """Return the name of each common cube, and its attributes in both results."""
        for name in self._names("cubes/*.h5"):
            paths = [folder / name for folder in self._folders]
            if all(path.exists() for path in paths):
                yield name, [{key: str(value) for key, value in store.attributes_of(path).items()} for path in paths]

    def _names(self, pattern: str) -> list[str]:
        return sorted(
            {path.relative_to(folder).as_posix() for folder in self._folders for path in folder.glob(pattern)}
        )

    def cube(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        """Yield the differences of a cube, group by group."""
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

    def table(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        """Yield the differences of a table; those of verdicts are told as claims."""
        self.left_out += [f"{name}: {column}" for column in sorted(volatile)]
        shown_above = {"verdict"} if name == str(CLAIMS.with_suffix(".csv")) else set()
        one, other = map(Texts, self._folders)
        return table_differences(name, one, other, volatile | shown_above)

    def files(self, pattern: str, differences: Callable[[str, set[str]], Iterator[Difference]]) -> Iterator[Difference]:
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


def _keys_that_differ(
    kind: str, both: Sequence[Mapping[str, Any]], where: str = "{}", show: Callable[[Any], Any] = lambda value: value
) -> Iterator[Difference]:
    """Yield the keys with different values, in the order of the first result; None marks a missing key."""
    one, other = both
    for key in dict.fromkeys([*one, *other]):
        if one.get(key) != other.get(key):
            yield Difference(kind=kind, where=where.format(key), a=show(one.get(key)), b=show(other.get(key)))


def _short_digest(digest: Any) -> Any:
    return digest[:10] if isinstance(digest, str) else digest
