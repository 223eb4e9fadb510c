"""The page of results, ``report.html``: one file that needs no network."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nearharmonic.reproduction.claims.pages.summary import failures, of_the_paper, sums
from nearharmonic.reproduction.report import assets
from nearharmonic.reproduction.report.plots import models
from nearharmonic.reproduction.report.shown.figures import ShownFigure, entries, interactive, static
from nearharmonic.reproduction.report.shown.links import Places
from nearharmonic.reproduction.report.shown.results import VERDICTS, ShownResults
from nearharmonic.reproduction.report.shown.tables import ShownTable
from nearharmonic.reproduction.tasks.experiment import Experiment, beside_the_paper

#: Maximum size of the page in bytes.
LARGEST = 6_000_000


@dataclass(frozen=True, kw_only=True)
class Section:
    """Results of an experiment; empty if its target has not been made."""

    experiment: Experiment
    figures: Sequence[ShownFigure]
    tables: Sequence[ShownTable]

    @property
    def anchor(self) -> str:
        """Id of the heading."""
        return self.experiment.name.replace("_", "-")

    @property
    def is_made(self) -> bool:
        """True if there are results."""
        return bool(self.figures or self.tables)


def sections_of(results: ShownResults) -> list[Section]:
    """Return the section of each experiment except the paper, with its results in ``results``."""
    return [
        Section(
            experiment=one,
            figures=list(static(results, one.figure_titles)),
            tables=results.tables(one.table_patterns),
        )
        for one in beside_the_paper()
    ]


def page(folder: str | os.PathLike[str], **_: Any) -> dict[str, str]:
    """Make the page of the results in a folder.

    Parameters
    ----------
    folder : path
        ``results/<name>``, with ``tables/claims.json``, ``tables/skipped.csv``, cubes and figures; other existing
        results are shown too.
    **_
        Paths of the files that a rule names as inputs, which are found in the folder.

    Returns
    -------
    dict
        ``page``, the text of the HTML file. The same results give the same text.

    Raises
    ------
    ResultFileError
        A cube or the table of claims is missing or damaged; the message names the command that makes it again.
    """
    results = ShownResults(Path(folder))
    figures = list(interactive(results))
    # Omissions and claims have their own sections.
    placed = ("skipped", "claims", *(pattern for one in beside_the_paper() for pattern in one.table_patterns))
    tables = results.tables(("table*", "*"), without=placed)
    plots = {name: plot for figure in figures for name, plot in figure.plots.items()}
    for name, plot in plots.items():
        plot.name = name  # the script of the page finds it by this id
    document, ids = models.document(list(plots.values()))
    sections = sections_of(results)
    places = Places(
        [*figures, *(figure for section in sections for figure in section.figures)],
        [*tables, *(table for section in sections for table in section.tables)],
    )
    values = {
        "results": results,
        "claims": [claim | {"pieces": places.pieces(claim)} for claim in results.claims],
        "counted": of_the_paper(results.claims),
        "sums": sums(results.claims),
        "failures": failures(results.claims),
        "looks": VERDICTS,
        "figures": figures,
        "legend": entries(figures),
        "tables": tables,
        "skipped": results.tables(("skipped",)),
        "sections": sections,
        # A "<" would end the script element.
        "document": document.replace("<", "\\u003c"),
        "roots": dict(zip(plots, ids, strict=True)),
    }
    return {"page": _small_enough(values)}


def _small_enough(values: Mapping[str, Any]) -> str:
    """Return the text of the page; the largest optional pictures are removed until it is small enough."""
    pictures = [figure for section in values["sections"] for figure in section.figures]
    pictures.sort(key=lambda figure: len(figure.picture))
    text = assets.filled(values)
    while pictures and len(text.encode()) > LARGEST:
        pictures.pop().picture = ""
        text = assets.filled(values)
    return text
