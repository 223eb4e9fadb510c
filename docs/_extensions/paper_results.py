"""Directives for results on the paper: statements with verdicts, its tables, and interactive figures."""

from __future__ import annotations

import json
import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.output.table import Table, in_markdown
from nearharmonic_paper.claims.claim import in_words
from nearharmonic_paper.experiments.paper.tableaus import paper_tables
from nearharmonic_paper.report.page import WORST_FIRST, figure_6_alive
from nearharmonic_paper.report.shown import Places, ShownFigure, ShownTable

if TYPE_CHECKING:
    from sphinx.application import Sphinx

CLAIMS = Path(__file__).parents[1] / "claims.json"
ALIVE = "figure_6_alive.html"
#: Results whose interactive figures are shown, if they have been made.
RESULTS = Path(__file__).parents[2] / "results/paper"
#: Cube of each figure of the paper; a statement that names no figure stands with the figure of its cube.
CUBES = {1: "sho", 2: "sho_terms", 3: "henon_heiles", 4: None, 5: "kepler", 6: "substeps"}
#: Colours of the verdicts, as sphinx-design names them.
COLOURS = {
    "holds": "success", "holds but for edges": "success-line", "holds in part": "warning", "fails": "danger",
    "erratum": "secondary",
}  # fmt: skip
PLACES = Places(
    [
        ShownFigure(anchor=f"figure-{i}", title=f"Figure {i}", caption="", stem="", cube=cube)
        for i, cube in CUBES.items()
    ],
    [ShownTable(anchor=f"table-{i}", caption="", file=f"table_{i}", header=[], rows=[]) for i in range(1, 5)],
)


def chosen(shown: str) -> list[dict[str, Any]]:
    """Return the statements of ``figure-N``, ``table-N`` or a kind such as ``misprint``, the worst first.

    Raises
    ------
    ValueError
        No statement is chosen.
    """
    entries = json.loads(CLAIMS.read_text(encoding="utf-8"))
    found = [one for one in entries if one["kind"] == shown or shown in (anchor for _, anchor in PLACES.pieces(one))]
    if not found:
        raise ValueError(f"no statement of {shown!r}: figure-N, table-N or a kind of statement")
    return sorted(found, key=lambda entry: WORST_FIRST.index(entry["verdict"]))


def described(entry: dict[str, Any]) -> list[str]:
    """Return the lines of a statement in Markdown."""
    words = {key: in_markdown(entry[key]) for key in ("statement", "value", "threshold", "margin")}
    sentence, section = (in_markdown(entry["paper"][key]) for key in ("sentence", "section"))
    return [
        f"{{bdg-{COLOURS[entry['verdict']]}}}`{entry['verdict']}` {words['statement']}.",
        f": *The paper:* “{sentence}” ({section}).",
        f": *Measured:* {words['value']}.",
        f": *Threshold:* {words['threshold']}. *Margin:* {words['margin']}.",
        "",
    ]


class Statements(SphinxDirective):
    """Statements of the paper with verdict, measured value, threshold and margin, from ``docs/claims.json``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return a sentence that counts them, and a definition list."""
        self.env.note_dependency(str(CLAIMS))
        entries = chosen(self.arguments[0])
        told = in_words(Counter(entry["verdict"] for entry in entries))
        lines = [f"{len(entries)} statements: {told}.", "", *(line for one in entries for line in described(one))]
        return self.parse_text_to_nodes("\n".join(lines))


@cache
def tables() -> dict[str, Table]:
    """Return the paper's tables by their file names."""
    return paper_tables(BENCHMARKED)


class PaperTable(SphinxDirective):
    """A table of the paper, computed while the site is built."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the caption and the table."""
        return self.parse_text_to_nodes(tables()[self.arguments[0]].markdown())


class Figure6Alive(SphinxDirective):
    """Figure 6 in motion, in a frame, which shows a page of its own."""

    def run(self) -> list[nodes.Node]:
        """Return the frame."""
        path = "../" * self.env.docname.count("/") + ALIVE
        frame = f'<iframe class="alive" src="{path}" title="Figure 6 in motion"></iframe>'
        return [nodes.raw("", frame, format="html")]


class LiveFigure(SphinxDirective):
    """An interactive figure of ``results/paper`` in a frame; it replaces the picture that follows it.

    Without results, or if an output has no scripts, the picture alone is shown.
    """

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the frame, and hide the picture."""
        file = RESULTS / f"figure-{self.arguments[0]}.html"
        self.env.note_dependency(str(file))
        if not file.is_file():
            return []
        path = "../" * self.env.docname.count("/") + file.name
        frame = (
            f'<iframe class="live" src="{path}" title="Figure {self.arguments[0]}, interactive" loading="lazy" '
            'sandbox="allow-scripts"></iframe><style>.live ~ p:has(> img:only-child) { display: none; }</style>'
        )
        return [nodes.raw("", frame, format="html")]


def write_frames(app: Sphinx, failure: Exception | None) -> None:
    """Write the pages of frames into the finished site: Figure 6 in motion, and the interactive figures."""
    if failure is None and app.builder.format == "html":
        (app.outdir / ALIVE).write_text(figure_6_alive(), encoding="utf-8")
        for file in RESULTS.glob("figure-[1-6].html"):
            # The footer leads to the page of results, which the site does not have.
            text = re.sub("<footer>.*?</footer>", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
            (app.outdir / file.name).write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives ``statements``, ``paper-table``, ``live-figure`` and ``figure-6-alive``."""
    app.add_directive("statements", Statements)
    app.add_directive("paper-table", PaperTable)
    app.add_directive("figure-6-alive", Figure6Alive)
    app.add_directive("live-figure", LiveFigure)
    app.connect("build-finished", write_frames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
