"""The page of results, ``report.html``: one file that needs no network."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nearharmonic.reproduction.claims.pages.summary import failures, of_the_paper, sums
from nearharmonic.reproduction.report import assets
from nearharmonic.reproduction.report.plots import models
from nearharmonic.reproduction.report.plots.durations import durations
from nearharmonic.reproduction.report.shown.figures import ShownFigure, interactive, static
from nearharmonic.reproduction.report.shown.legend import entries
from nearharmonic.reproduction.report.shown.links import Places
from nearharmonic.reproduction.report.shown.results import VERDICTS, ShownResults
from nearharmonic.reproduction.report.shown.tables import ShownTable
from nearharmonic.reproduction.tasks.receipts import RUN, measures_time

#: Bytes of the page.
LARGEST = 6_000_000


@dataclass(frozen=True, kw_only=True)
class Section:
    """Results of one kind, which may have been made or not.

    Attributes
    ----------
    anchor, title, target : str
        Its id, its heading, and the target that makes it.
    about : str
        What it shows, in a sentence.
    figures : mapping of str to str
        Titles of its figures, by patterns of the names of their files, without endings.
    tables : tuple of str
        Patterns of the names of its tables' files.
    """

    anchor: str
    title: str
    target: str
    about: str
    figures: Mapping[str, str] = field(default_factory=dict)
    tables: tuple[str, ...] = ()
    shown_figures: Sequence[ShownFigure] = ()
    shown_tables: Sequence[ShownTable] = ()

    @property
    def is_made(self) -> bool:
        """True if there is anything to show."""
        return bool(self.shown_figures or self.shown_tables)

    def of(self, results: ShownResults) -> Section:
        """Return the section with what ``results`` has of it."""
        figures = list(static(results, self.figures))
        return replace(self, shown_figures=figures, shown_tables=results.tables(self.tables))


OPTIONAL = (
    Section(
        anchor="stability",
        title="Stability",
        target="stability",
        about="Where the methods may be trusted: linear limits, ensembles, round-off, and T that is not quadratic.",
        figures={
            "linear_stability": "Linear stability",
            "henon_heiles_stability": "Ensembles on energy surfaces of Hénon and Heiles",
            "kepler_stability": "Kepler orbits by eccentricity",
            "rounding_growth": "Growth of rounding errors",
            "kinetic_energy": "A kinetic energy that is not quadratic",
        },
        tables=("linear_stability", "stability_*", "structure", "kinetic_energy"),
    ),
    Section(
        anchor="work-precision",
        title="Run time against error",
        target="work_precision",
        about="Wall-clock time of one trajectory against its error, beside other libraries; it depends on the machine.",
        figures={
            "library_times_trajectory": "One trajectory, beside other libraries",
            "library_times_ensemble": "Ensembles, beside other libraries",
            "work_precision_*": "Run time against error",
            "regularised_times": "Kepler's problem regularised",
        },
        tables=("library_times", "work_precision_*"),
    ),
    Section(
        anchor="exact-oscillator",
        title="Oscillator solved exactly",
        target="exact_oscillator",
        about="The oscillator of the system of Hénon and Heiles solved exactly, beside T + V, over the amplitude.",
        figures={
            "exact_oscillator_error": "Energy error against amplitude",
            "exact_oscillator_charge": "Amplitude up to which the exact oscillator is ahead, against its cost",
        },
        tables=("exact_oscillator", "exact_oscillator_times"),
    ),
    Section(
        anchor="trained",
        title="Trained methods",
        target="trained",
        about="Methods whose coefficients a search has chosen, on problems that none was trained on.",
        figures={
            "trained_error": "Energy error on ensembles",
            "trained_gain": "Gain over the best published method",
            "trained_ideas": "Five ideas, by anharmonicity",
        },
        tables=("trained_*",),
    ),
    Section(
        anchor="derivation",
        title="Derivation",
        target="derive",
        about="The coefficients of Table 4 again, from random starts, with proofs.",
        tables=("table4_derived", "derived_*"),
    ),
    Section(
        anchor="sixth-order",
        title="Methods of order six with a harmonic order",
        target="sixth_order",
        about="Methods beyond the paper, searched for, ranked and measured.",
        tables=("sixth_order_*",),
    ),
)
#: What is left out and the claims have places of their own.
_PLACED = ("skipped", "claims", *(pattern for section in OPTIONAL for pattern in section.tables))


@measures_time
def page(folder: str | os.PathLike[str], run: str | None = None, **_: Any) -> dict[str, str]:
    """Make the page of the results in a folder.

    Parameters
    ----------
    folder : path
        ``results/<name>``, with ``tables/claims.json``, ``tables/skipped.csv``, cubes and figures; whatever else has
        been made is shown as well.
    run : str, optional
        Id of the run that makes the page; by default that of the environment variable
        :data:`nearharmonic.reproduction.tasks.receipts.RUN`.
    **_
        Paths of the files that a rule names as inputs, which are found in the folder.

    Returns
    -------
    dict
        ``page``, the text of the HTML file. The same results and history give the same text.

    Raises
    ------
    ResultFileError
        A cube or the table of claims is missing or damaged; the message names the command that makes it again.
    """
    results = ShownResults(Path(folder))
    figures = list(interactive(results))
    tables = results.tables(("table*", "*"), without=_PLACED)
    plots = {name: plot for figure in figures for name, plot in figure.plots.items()}
    if any(one.get("duration") is not None for one in results.finished):
        plots["history-chart"] = durations(results.finished)[0].plot
    for name, plot in plots.items():
        plot.name = name  # by which the script of the page finds it
    document, ids = models.document(list(plots.values()))
    asked = run or os.environ.get(RUN)
    sections = [section.of(results) for section in OPTIONAL]
    places = Places(
        [*figures, *(figure for section in sections for figure in section.shown_figures)],
        [*tables, *(table for section in sections for table in section.shown_tables)],
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
        "run": results.run(asked),
        "asked": asked,
        "document": assets.as_script(document),
        "roots": dict(zip(plots, ids, strict=True)),
    }
    return {"page": _small_enough(values)}


def _small_enough(values: Mapping[str, Any]) -> str:
    """The text of the page; while it is too large, it loses the largest of its optional pictures."""
    pictures = [figure for section in values["sections"] for figure in section.shown_figures]
    pictures.sort(key=lambda figure: len(figure.picture))
    text = assets.filled(values)
    while pictures and len(text.encode()) > LARGEST:
        pictures.pop().picture = ""
        text = assets.filled(values)
    return text
