"""Metadata of an archive for a deposit at Zenodo, ``.zenodo.json``.

The keys are those of deposits in Zenodo's REST API. There is no date: Zenodo adds that of the publication.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from nearharmonic_paper.record.archive.description.software import homepage
from nearharmonic_paper.record.archive.description.summary import KEYWORDS, Run, abstract, title

#: Name of the file in the archive.
ZENODO = ".zenodo.json"
#: Address of a preprint at arXiv before its number.
_ARXIV = "https://arxiv.org/abs/"


def zenodo(result: str, cited: Mapping[str, Any], runs: Sequence[Run], left_out: int) -> bytes:
    """Return the metadata, JSON in UTF-8.

    Parameters
    ----------
    result, runs, left_out
        As for :func:`nearharmonic_paper.record.archive.description.metadata.metadata`.
    cited : mapping
        Content of ``CITATION.cff``.
    """
    related = [_publication(reference) for reference in cited["references"]]
    made_by = {"identifier": homepage(cited), "relation": "isCompiledBy", "resource_type": "software", "scheme": "url"}
    found = {
        "title": title(result),
        "upload_type": "dataset",
        "description": f"<p>{escape(abstract(runs, left_out))}</p>",
        "creators": [_creator(author) for author in cited["authors"]],
        "access_right": "open",
        "license": cited["license"],
        "keywords": list(KEYWORDS),
        "language": "eng",
        "related_identifiers": [*related, made_by],
    }
    return json.dumps(found, indent=1, ensure_ascii=False).encode() + b"\n"


def _creator(author: Mapping[str, Any]) -> dict[str, str]:
    """Return a person, or an entity with a name, of the citation file as a creator."""
    name = author.get("name") or f"{author['family-names']}, {author['given-names']}"
    orcid = str(author.get("orcid", "")).rpartition("/")[2]
    given = {"name": name, "affiliation": author.get("affiliation", ""), "orcid": orcid}
    return {key: value for key, value in given.items() if value}


def _publication(reference: Mapping[str, Any]) -> dict[str, str]:
    """Return a reference of the citation file; a preprint has its identifier at arXiv."""
    url = str(reference["url"])
    at_arxiv = url.startswith(_ARXIV)
    return {
        "identifier": f"arXiv:{url.removeprefix(_ARXIV)}" if at_arxiv else url,
        "relation": "references",
        "resource_type": "publication-preprint" if at_arxiv else "publication-article",
        "scheme": "arxiv" if at_arxiv else "url",
    }
