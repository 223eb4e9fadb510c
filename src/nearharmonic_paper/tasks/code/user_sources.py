"""Digests of users' Python files, and of the modules that they import from their folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path

from nearharmonic.errors import SettingError
from nearharmonic.registry.user_module import is_file
from nearharmonic_paper.tasks.code.sources import PACKAGES, Source, reached, read_source


def files_of(place: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Return a user's file, followed by the sorted files in its folder that it imports, directly or indirectly.

    Files that it reads in another way, for example with ``open``, are not included.

    Raises
    ------
    SettingError
        The file cannot be read.
    """
    first = Path(place)
    return first, *sorted(reached([first], partial(_beside, first.parent)) - {first})


def _beside(folder: Path, path: Path) -> Iterator[Path]:
    """Return the files below ``folder`` that a file there imports."""
    package = path.parent if path.parent != folder else folder
    for written in _source(path).imports:
        name = written.lstrip(".")
        level = len(written) - len(name) - 1
        if level > len(package.parents):
            continue
        above = package.parents[level - 1] if level > 0 else package
        start = above if written.startswith(".") else folder
        parts = name.split(".") if name else []
        for end in range(1, len(parts) + 1):
            stem = start.joinpath(*parts[:end])
            beside = (stem.with_suffix(".py"), stem / "__init__.py")
            yield from (one for one in beside if one.is_relative_to(folder) and is_file(one))


def package_modules_of(place: str | os.PathLike[str]) -> set[str]:
    """Return the dotted names of this package that a user's file and its imported files import.

    A name may also be that of a function or class.

    Raises
    ------
    SettingError
        The file cannot be read.
    """
    written = (name for path in files_of(place) for name in _source(path).imports)
    return {name for name in written if name.split(".")[0] in PACKAGES}


def digest_of(place: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of the syntax trees of the files of :func:`files_of` without docstrings and comments.

    Raises
    ------
    SettingError
        The file cannot be read.
    """
    first, *others = files_of(place)
    digest = sha256(_source(first).digest.encode())
    for path in others:
        digest.update(f"{path.relative_to(first.parent).as_posix()} {_source(path).digest}\n".encode())
    return digest.hexdigest()


def _source(path: Path) -> Source:
    if not is_file(path):
        raise SettingError(f"{path} is no file")
    try:
        return read_source(path)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        message = f"{path} cannot be read: {error}"
        raise SettingError(message) from error
