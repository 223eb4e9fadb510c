"""The workflow in an archive: its files, and the main workflow as Workflow RO-Crate 1.0 describes it.

The files are those of the present installation, as ``LICENSE`` and ``CITATION.cff`` are. The version and the commit
behind each run are those of its software.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import nearharmonic
from nearharmonic_paper.record.archive.description.member import Member, format_of
from nearharmonic_paper.record.archive.description.software import homepage, workflow_root

#: File of the main workflow, and patterns of the files that it reads.
MAIN, _PARTS = "Snakefile", ("workflow/**/*",)
#: Types of the main workflow, and the language of its file as the profile names it.
TYPES = ["File", "SoftwareSourceCode", "ComputationalWorkflow"]
LANGUAGE = {
    "@id": "https://w3id.org/workflowhub/workflow-ro-crate#snakemake",
    "@type": "ComputerLanguage",
    "name": "Snakemake",
    "identifier": {"@id": "https://doi.org/10.1093/bioinformatics/bts480"},
    "url": {"@id": "https://snakemake.readthedocs.io"},
}


def members() -> list[Member]:
    """Return the files of the workflow.

    Raises
    ------
    SettingError
        The package has come without the workflow.
    """
    root = workflow_root()
    paths = [root / MAIN, *(path for pattern in _PARTS for path in sorted(root.glob(pattern)))]
    files = [path for path in paths if path.is_file() and "__pycache__" not in path.parts]
    return [_member(path.relative_to(root).as_posix(), path.read_bytes()) for path in files]


def _member(name: str, content: bytes) -> Member:
    return Member.of_bytes(name, content, f"File of the workflow of nearharmonic, {format_of(name)[1]}.")


def described(crate: Any, cited: Mapping[str, Any]) -> dict[str, Any]:
    """Return the properties of the main workflow beyond those of every file; add its language to ``crate``."""
    language = crate.get(LANGUAGE["@id"]) or crate.add_jsonld(dict(LANGUAGE))
    return {
        "@type": TYPES,
        "name": "Workflow of nearharmonic",
        "url": homepage(cited),
        "version": nearharmonic.__version__,
        "programmingLanguage": language,
    }
