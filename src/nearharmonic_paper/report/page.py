"""The page of results, ``report.html``, and a page of each interactive figure alone; they need no network."""

from __future__ import annotations

import gzip
import os
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.output.table import short
from nearharmonic_paper.claims.claim import FINDING, OPEN, deciders, failures, of_the_paper, sums
from nearharmonic_paper.report import shown as wording
from nearharmonic_paper.report.shown import (
    Places,
    ShownFigure,
    ShownResults,
    ShownTable,
    coefficients,
    entries,
    interactive,
    pages_alone,
    static,
)
from nearharmonic_paper.tasks.experiment import Experiment, beside_the_paper

# --- Assets of the page: its template, style and script.

FOLDER = Path(__file__).parent / "template"
NAMES = ("page.html", "figure.html", "parts.html", "page.css", "page.js", "alive.js")


def digest() -> str:
    """Return the SHA-256 of the parts of the page that the code digest of the package does not cover.

    These are the assets, the version of bokeh, and the declarations of experiments.
    """
    told = [version("bokeh").encode(), repr(beside_the_paper()).encode()]
    return sha256(b"\0".join([*told, *((FOLDER / name).read_bytes() for name in NAMES)])).hexdigest()


def packed(text: str) -> str:
    """Return a text compressed with gzip, in base64: a third of the size of a document of plots."""
    return b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def filled(name: str, values: Mapping[str, Any]) -> str:
    """Return a template filled with ``values``; text is escaped, style and scripts are inserted unchanged."""
    return str(_templates().get_template(name).render(values))


@cache
def _templates() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    from nearharmonic_paper.report import plots

    trimmed: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "undefined": StrictUndefined}
    environment = Environment(loader=FileSystemLoader(FOLDER), autoescape=True, **trimmed)
    assets = {"style": "page.css", "script": "page.js", "alive_script": "alive.js"}
    texts = {name: Markup((FOLDER / asset).read_text(encoding="utf-8")) for name, asset in assets.items()}
    told = {"wording": wording, "short": short, "looks": wording.VERDICTS, "bokeh": packed(plots.script())}
    environment.globals |= texts | told
    return environment


# --- Content of the page.

#: Maximum size of the page in bytes.
LARGEST = 4_000_000
#: Verdicts in the order of the statements beneath a figure.
WORST_FIRST = ("fails", "erratum", "holds in part", "holds but for edges", "holds", OPEN)
#: Figure at the top of the page; without it, the figure of the config's own system, or the figure of this cube.
FIRST_SHOWN, OR_OF_CUBE = "gain", "henon_heiles"


class Section(NamedTuple):
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


def page(folder: str | os.PathLike[str], leftovers: Sequence[str] = (), **_: Any) -> dict[str, str]:
    """Return ``page``, the text of the page of the results in a folder, and the pages of single figures by output.

    The same results give the same text. The folder has ``tables/claims.json``, ``tables/skipped.csv``, cubes and
    figures; other existing results are shown too, and verdicts if one of the paper's systems has a cube. The last line
    names ``leftovers``, files that the config does not make, and nothing shows them. Further arguments are the
    integrators, which a rule names for their digests, and paths of its inputs, which are found in the folder. A
    ResultFileError says that a cube or the table of claims is missing or damaged.
    """
    from nearharmonic_paper.report import plots

    results = ShownResults(Path(folder), leftovers)
    figures = list(interactive(results))
    # Omissions and claims have their own sections.
    placed = ("skipped", "claims", *(pattern for one in beside_the_paper() for pattern in one.table_patterns))
    tables = results.tables(("table*", "*"), without=placed)
    for figure in figures:
        figure.document = packed(plots.document(figure.plots)) if figure.panels else ""
    sections = [
        Section(one, list(static(results, one.figure_titles)), results.tables(one.table_patterns))
        for one in beside_the_paper()
    ]
    every = [*figures, *(figure for section in sections for figure in section.figures)]
    places = Places(every, [*tables, *(table for section in sections for table in section.tables)])
    claims = [claim | {"pieces": places.pieces(claim)} for claim in results.claims]
    for figure in every:
        own = (claim for claim in claims if claim["kind"] != FINDING and figure.anchor in places.figures(claim))
        figure.statements = sorted(own, key=lambda claim: WORST_FIRST.index(claim["verdict"]))
    first = [one for one in every if one.stem == FIRST_SHOWN]
    first += [one for one in figures if one.is_own or one.cube == OR_OF_CUBE] or every
    later = {target: time for target, time in deciders(results.claims) if target != "all"}
    values = {
        "results": results,
        "claims": claims,
        "counted": of_the_paper(results.claims),
        "sums": sums(results.claims),
        "failures": failures(results.claims),
        "figures": figures,
        "own": [results.labels[str(one.cube)] for one in figures if one.is_own],
        "every": every,
        "first": next(iter(first), None),
        "later": later,
        "methods": coefficients(
            one.method for one in entries(figures) if "figure-6" in {each.anchor for each in figures}
        ),
        "tables": tables,
        "skipped": results.tables(("skipped",)),
        "sections": sections,
        "documents": [figure.document for figure in figures if figure.document],
    }
    return {"page": _small_enough(values), **_alone(results, figures)}


def figure_6_alive() -> str:
    """Return a page with Figure 6 in motion alone, for the methods of the paper's figures."""
    return filled("alive.html", {"methods": coefficients(BENCHMARKED)})


def _alone(results: ShownResults, figures: Sequence[ShownFigure]) -> dict[str, str]:
    """Return the page of each interactive figure, by the names of their outputs."""
    live = [one for one in figures if one.panels]
    named = zip(pages_alone(results.figures), live, strict=True)
    return {name: filled("figure.html", {"results": results, "figure": one}) for name, one in named}


def _small_enough(values: Mapping[str, Any]) -> str:
    """Return the text of the page; the largest optional pictures are removed until it is small enough."""
    pictures = [figure for section in values["sections"] for figure in section.figures]
    pictures.sort(key=lambda figure: len(figure.picture))
    while len((text := filled("page.html", values)).encode()) > LARGEST and pictures:
        pictures.pop().picture = ""
    return text
