"""Links from the claims to the figures and tables with their numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from nearharmonic_paper.report.shown.figures import ShownFigure
from nearharmonic_paper.report.shown.tables import ShownTable

#: A piece of text, and the anchor of its link, "" without a link.
Piece = tuple[str, str]

#: Pattern of figures and tables in the text of a claim.
_NAMED = re.compile(r"\b(Figures?|Figs?\.|Tables?)\s+(\d+(?:(?:,\s*|\s*(?:and|to|-|–)\s*)\d+)*)")
_NUMBERED = re.compile(r"(figure|table)-(\d+)")


class Places:
    """Places of all figures and tables on the page."""

    def __init__(self, figures: Iterable[ShownFigure], tables: Iterable[ShownTable]) -> None:
        self._shown: dict[str, list[Piece]] = {}
        self._anchors: set[str] = set()
        for figure in figures:
            self._add(f"cubes/{figure.cube}.h5", figure.anchor, figure.title)
        for table in tables:
            name = table.file.rpartition("/")[2].partition(".")[0]
            self._add(table.file, table.anchor, f"table of {name.replace('_', ' ')}")

    def _add(self, file: str, anchor: str, title: str) -> None:
        numbered = _NUMBERED.fullmatch(anchor)
        self._anchors.add(anchor)
        self._shown.setdefault(file, []).append(
            (f"{numbered[1].capitalize()} {numbered[2]}" if numbered else title, anchor)
        )

    def pieces(self, claim: Mapping[str, Any]) -> list[Piece]:
        """Return the position of ``claim`` in the paper, with links to the figures and tables that it names.

        If it names none on the page, links to the figures and tables of the files of the claim follow.
        """
        pieces = self._named(str(claim["paper"]["section"]))
        if any(anchor for _, anchor in pieces):
            return pieces
        shown = dict.fromkeys(piece for file in claim["needs"] for piece in self._shown.get(str(file), []))
        for i, piece in enumerate(shown):
            pieces += [(", " if i else "; shown in ", ""), piece]
        return pieces

    def figures(self, claim: Mapping[str, Any]) -> list[str]:
        """Return the ids of the figures that show the data of ``claim`` or that its place in the paper names."""
        anchors = [anchor for _, anchor in self.pieces(claim)]
        return [anchor for anchor in dict.fromkeys(anchors) if anchor.startswith("figure-")]

    def _named(self, text: str) -> list[Piece]:
        pieces: list[Piece] = []
        end = 0
        for named in _NAMED.finditer(text):
            kind = "table" if named[1].startswith("Table") else "figure"
            for number in re.finditer(r"\d+", named[2]):
                anchor = f"{kind}-{number[0]}"
                if anchor in self._anchors:
                    begin = named.start(2) + number.start() if number.start() else named.start()
                    stop = named.start(2) + number.end()
                    pieces += [(text[end:begin], ""), (text[begin:stop], anchor)]
                    end = stop
        return [piece for piece in [*pieces, (text[end:], "")] if piece[0]]
