"""Sphinx extension: in each page written by hand, the first use of a term of the glossary leads to its definition."""

from __future__ import annotations

import re
from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

GLOSSARY = Path(__file__).parents[1] / "reference/glossary.md"
#: Pages of definitions and of lists, in which a link at a word leads away from what is looked for.
WITHOUT = ("reference/", "developers/changelog", "results/claims", "index")
#: Nodes whose text is left as it is.
CLOSED = (nodes.reference, nodes.literal, nodes.title, nodes.math, nodes.term, nodes.caption, addnodes.pending_xref)
_ARTICLE = r"\b(?:a|an|the|each|every|one|this) "
#: Terms that are also everyday words, by the surroundings in which the term is meant.
MEANT = {
    "order": r"\b((?:second|fourth|sixth|eighth|tenth) order)\b|(?<!harmonic )(?<!generalised )\b(order [0-9]+)\b",
    "kernel": r"\b(?:compiled|numba|cached) (kernels?)\b|\b(kernel) cache\b",
    "gap": r"\b(?:first|second|next|stability) (gaps?)\b",
    "BAB": r"\b(BAB)(?![’'\w])",
    "BAB'": r"\b(BAB['’])(?!s)",
    "claim": r"\b(claims?) of the paper\b",
    "cube": rf"{_ARTICLE}(cube)\b(?! of the)",
    **{word: rf"{_ARTICLE}({word})\b" for word in ("run", "plan", "trend", "digest", "shard", "lane")},
}


def patterns(text: str) -> dict[str, re.Pattern[str]]:
    """Return what is searched for each term of the text of a glossary, the longest term first."""
    blocks = re.findall(r"```\{glossary\}\n(.*?)```", text, flags=re.DOTALL)
    terms = [line for block in blocks for line in block.splitlines() if line and not line.startswith(" ")]
    exact = {term: MEANT.get(term, rf"\b({re.escape(term)}s?)\b") for term in terms}
    # Capitals count in ABA and BAB, and not in a word that begins a sentence.
    flags = {term: 0 if term.isupper() or "'" in term else re.IGNORECASE for term in terms}
    return {term: re.compile(exact[term], flags[term]) for term in sorted(terms, key=len, reverse=True)}


class GlossaryLinks(SphinxTransform):
    """Puts a reference in place of the first use of each term."""

    default_priority = 500  # after the nodes of Markdown are complete, before references are resolved

    def apply(self) -> None:
        """Change the paragraphs of the page."""
        if any(part in self.env.docname for part in WITHOUT):
            return
        self.env.note_dependency(str(GLOSSARY))
        wanted = patterns(GLOSSARY.read_text(encoding="utf-8"))
        for paragraph in list(self.document.findall(nodes.paragraph)):
            for found in list(paragraph.findall(nodes.Text)):
                if not _within(found, CLOSED):
                    found.parent.replace(found, _linked(str(found), wanted))


def _within(node: nodes.Node, kinds: tuple[type, ...]) -> bool:
    while (node := node.parent) is not None:
        if isinstance(node, kinds):
            return True
    return False


def _linked(text: str, wanted: dict[str, re.Pattern[str]]) -> list[nodes.Node]:
    """Return the nodes of a text; the terms that it has are taken out of ``wanted``."""
    for term, pattern in wanted.items():
        if match := pattern.search(text):
            del wanted[term]
            start, end = match.span(match.lastindex)
            shown = nodes.inline("", text[start:end], classes=["std", "std-term"])
            link = addnodes.pending_xref("", shown, refdomain="std", reftype="term", reftarget=term, refexplicit=True)
            return [*_linked(text[:start], wanted), link, *_linked(text[end:], wanted)]
    return [nodes.Text(text)] if text else []


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(GlossaryLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
