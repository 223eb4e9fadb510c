"""Result folders by name."""

from __future__ import annotations

from pathlib import Path

from nearharmonic.errors import UnknownNameError, unknown_name

#: The folder of all results, below that of the project.
RESULTS = Path("results")
#: Files and folders that identify a folder of results: it has at least one.
SIGNS = ("manifest.json", "history.jsonl", "cubes", "logs/running")


def folder_of(name: str) -> Path:
    """Return the folder of a result by its path, or its name below ``results/``; else raise UnknownNameError."""
    for folder in (Path(name), RESULTS / name):
        if is_result(folder):
            return folder
    known = result_names()
    if not known:
        says = f"no folder below {RESULTS}/ holds a result. Make the first: snakemake -j2"
        raise UnknownNameError(f"unknown result {name!r}: {says}")
    raise unknown_name("result", name, known)


def result_names() -> list[str]:
    """Return the sorted names of the folders below ``results/`` with a result."""
    if not RESULTS.is_dir():
        return []
    return sorted(folder.name for folder in RESULTS.iterdir() if is_result(folder))


def is_result(folder: Path) -> bool:
    """Return True if ``folder`` has a manifest, a history or a folder of cubes."""
    return any((folder / sign).exists() for sign in SIGNS)
