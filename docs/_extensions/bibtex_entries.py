"""BibTeX entries of sources: those of paper.bib where it has them, and the text of the source elsewhere."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Sources of this project begin so; references in them are to the work that they build on.
OWN = ("found by", "trained by")


@cache
def entries() -> dict[str, str]:
    """Return the entries of paper.bib by their keys."""
    text = (ROOT / "paper.bib").read_text(encoding="utf-8")
    return {entry[1]: entry[0] for entry in re.finditer(r"^@\w+\{([^,]+),.*?^\}", text, re.MULTILINE | re.DOTALL)}


@cache
def software() -> str:
    """Return the entry of this software, from CITATION.cff."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    found = dict(re.findall(r'^(?:  - )?([\w-]+): "?(.*?)"?$', text.partition("references:")[0], re.MULTILINE))
    members = {
        "author": f"{{{found['name']}}}",
        "title": found["title"],
        "version": found["version"],
        "url": found["repository-code"],
    }
    return _entry("software", "nearharmonic", members)


def bibtex_of(name: str, source: str) -> str:
    """Return the BibTeX entries of a source.

    Parameters
    ----------
    name : str
        Key of the entry that is made if paper.bib has none.
    source : str
        Source of a method or a system: a text with identifiers such as doi:10.1103/PhysRev.159.98.
    """
    cited = [entry for entry in entries().values() if _is_of(entry, source)]
    if source.startswith(OWN):
        return "\n\n".join([software(), *cited])
    return "\n\n".join(cited) or _entry("misc", name, {"note": source, **_address(source)})


def linked(source: str) -> str:
    """Return a source as Markdown, in which its identifiers are links."""
    text = re.sub(r"doi:(10\.\S+?)(?=[;,.:]?(?:\s|$))", r"[doi:\1](<https://doi.org/\1>)", source)
    text = re.sub(r"arXiv:(\d+\.\d+)", r"[arXiv:\1](https://arxiv.org/abs/\1)", text)
    return re.sub(r"(?<![<(])(https://[^\s,;)]+)", r"<\1>", text)


def _is_of(entry: str, source: str) -> bool:
    """Return True if an entry has an identifier of the source or, if it has none, its first author and year."""
    known = re.findall(r"^  (?:doi|eprint) = \{(.*?)\}", entry, re.MULTILINE)
    if known:
        return any(re.search(rf"(?:doi|arXiv):{re.escape(one)}(?![\w.-]*\w)", source) for one in known)
    author, year = (re.findall(rf"^  {key} = \{{(\w+)", entry, re.MULTILINE)[0] for key in ("author", "year"))
    return re.match(rf"{author}\b[^(]*\({year}\)", source) is not None


def _address(source: str) -> dict[str, str]:
    found = re.search(r"https://[^\s,;)]+", source)
    return {"url": found[0]} if found else {}


def _entry(kind: str, key: str, members: dict[str, str]) -> str:
    written = [f"  {name} = {{{value if name == 'url' else _escaped(value)}}}" for name, value in members.items()]
    lines = ",\n".join(written)
    return f"@{kind}{{{key},\n{lines}\n}}"


def _escaped(text: str) -> str:
    return re.sub(r"([&_#%])", r"\\\1", text)
