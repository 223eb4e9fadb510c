"""Result folders by name: where the results of a config are, and which results there are."""

from __future__ import annotations

from pathlib import Path

from nearharmonic.errors import UnknownNameError, unknown_name

#: The folder of all results, below that of the project.
RESULTS = Path("results")
#: What tells a folder of results from any other: one of these is in it.
SIGNS = ("manifest.json", "history.jsonl", "cubes", "logs/running")


def folder_of(name: str) -> Path:
    """Return the folder of a result.

    Parameters
    ----------
    name : str
        The folder itself, or its name below ``results/``.

    Raises
    ------
    UnknownNameError
        Neither is a folder that holds a result.
    """
    for folder in (Path(name), RESULTS / name):
        if is_result(folder):
            return folder
    known = result_names()
    if not known:
        message = f"unknown result {name!r}: no folder below {RESULTS}/ holds a result. Make the first: snakemake -j2"
        raise UnknownNameError(message)
    raise unknown_name("result", name, known)


def result_names() -> list[str]:
    """Return the names of the folders below ``results/`` that hold a result, sorted."""
    if not RESULTS.is_dir():
        return []
    return sorted(folder.name for folder in RESULTS.iterdir() if is_result(folder))


def is_result(folder: Path) -> bool:
    """Return whether ``folder`` holds a result: a manifest, a history or a folder of cubes."""
    return any((folder / sign).exists() for sign in SIGNS)
