"""Content of the page for a folder of results: claims, tables and figures, read from files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.store import attributes_of
from nearharmonic_paper.claims.claim import OPEN
from nearharmonic_paper.experiments.paper.grid.omissions import Totals, totals_in
from nearharmonic_paper.experiments.paper.settings import PAPER
from nearharmonic_paper.record.files.texts import Texts
from nearharmonic_paper.report.shown.declared import in_order
from nearharmonic_paper.report.shown.pictures import thumbnail
from nearharmonic_paper.report.shown.tables import ShownTable, tables_of
from nearharmonic_paper.tasks.declarations import Figure, figures_of

#: Verdicts in the order of the page, each with the name of its style.
VERDICTS = {
    "holds": "holds",
    "holds but for edges": "edges",
    "holds in part": "part",
    "fails": "fails",
    "erratum": "erratum",
    OPEN: "open",
}


class ShownResults:
    """A folder of results, ``results/<name>``, without files of these names, which are leftovers of another config.

    A ResultFileError says that a file is missing or damaged, and has the command that makes it again.
    """

    def __init__(self, folder: Path, leftovers: Sequence[str] = ()) -> None:
        self.folder = folder
        self._leftovers = leftovers
        self._texts = Texts(folder)

    @cached_property
    def claims(self) -> list[dict[str, Any]]:
        """The objects of ``tables/claims.json``; none without a system of the paper."""
        if not self.has_systems_of_the_paper:
            return []
        name = "tables/claims.json"
        text = self._texts.read(name)
        try:
            found = list(json.loads(text))
            known = all(claim["verdict"] in VERDICTS and claim["paper"]["sentence"] for claim in found)
        except (ValueError, KeyError, TypeError) as error:
            raise self._texts.unusable(name, "is damaged") from error
        if not known:
            raise self._texts.unusable(name, f"has a verdict that is none of {', '.join(VERDICTS)}")
        return found

    @cached_property
    def figures(self) -> list[Figure]:
        """The existing declared figures, in the order of the page."""
        cubes = self.stems("cubes", ".h5")
        drawn = self.stems("figures", ".svg")
        return in_order(one for one in figures_of(cubes, cubes) if one.stem in drawn)

    @property
    def has_systems_of_the_paper(self) -> bool:
        """True if a system of the paper has a cube."""
        return not set(PAPER).isdisjoint(self.labels)

    @property
    def leftovers(self) -> list[str]:
        """Names of the leftovers, each once for all its formats."""
        return sorted({name.partition(".")[0] for name in self._leftovers})

    def svg(self, stem: str) -> str:
        """Return the text of the SVG file of a figure."""
        return self._texts.read(f"figures/{stem}.svg")

    def thumbnail(self, stem: str) -> str:
        """Return the data URI of a small picture of a figure, "" without its PNG file."""
        place = self.folder / f"figures/{stem}.png"
        return thumbnail(place) if place.is_file() else ""

    @property
    def files(self) -> dict[str, list[str]]:
        """Paths of all cubes and tables, by kind."""
        kinds = {"cubes": ".h5", "tables": ".csv"}
        return {kind: [f"{kind}/{stem}{suffix}" for stem in self.stems(kind, suffix)] for kind, suffix in kinds.items()}

    def cube(self, name: str) -> Path:
        """Return the path of a cube."""
        return self.folder / "cubes" / f"{name}.h5"

    @cached_property
    def labels(self) -> dict[str, str]:
        """Labels of the systems that have a cube, by name."""
        attributes = {stem: attributes_of(self.cube(stem)) for stem in self.stems("cubes", ".h5")}
        return {stem: told["system_label"] for stem, told in attributes.items() if "system_label" in told}

    def stems(self, folder: str, suffix: str, patterns: Sequence[str] = ("*",)) -> list[str]:
        """Return the names of the files below ``folder`` that match one of ``patterns``, sorted by pattern and name."""
        paths = (self.folder / folder).glob(f"*{suffix}")
        found = sorted(path.stem for path in paths if f"{folder}/{path.name}" not in self._leftovers)
        return list(dict.fromkeys(stem for pattern in patterns for stem in found if fnmatch(stem, pattern)))

    def tables(self, patterns: Sequence[str], without: Sequence[str] = ()) -> list[ShownTable]:
        """Read the tables whose file names match one of ``patterns`` and none of ``without``; all anchors differ."""
        found: dict[str, ShownTable] = {}
        for stem in self.stems("tables", ".csv", patterns):
            if not any(fnmatch(stem, pattern) for pattern in without):
                has_markdown = (self.folder / "tables" / f"{stem}.md").is_file()
                for one in tables_of(self._texts, stem, has_markdown=has_markdown):
                    anchor = f"{one.anchor}-{len(found)}" if one.anchor in found else one.anchor
                    found[anchor] = replace(one, anchor=anchor)
        return list(found.values())

    @cached_property
    def saving(self) -> Totals:
        """The totals of ``tables/skipped.csv``."""
        name = "tables/skipped.csv"
        text = self._texts.read(name)
        try:
            return totals_in(text)
        except NearharmonicError as error:
            raise self._texts.unusable(name, "holds no totals") from error
