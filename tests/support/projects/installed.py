"""Sizes of installed packages."""

from __future__ import annotations

from functools import cache
from importlib.metadata import distribution

from packaging.requirements import Requirement


def closure(requirement):
    """Names of the distributions that a requirement installs, in this environment."""
    found, todo = {}, [Requirement(requirement)]
    while todo:
        one = todo.pop()
        extras = {"", *one.extras} - found.get(one.name, set())
        found.setdefault(one.name, set()).update(extras)
        for extra in extras:
            inner = (Requirement(text) for text in distribution(one.name).requires or ())
            todo += [each for each in inner if belongs(each, extra)]
    return set(found)


def belongs(requirement, extra):
    """Return True if a requirement counts with an extra, and with "" only if it counts without any."""
    marker = requirement.marker
    if marker is None:
        return not extra
    return marker.evaluate({"extra": extra}) and (not extra or not marker.evaluate({"extra": ""}))


def mebibytes_of(names):
    """Size of the files of distributions, compiled Python included."""
    return sum(dict(item for name in names for item in _sizes_of(name).items()).values()) / 2**20


@cache
def _sizes_of(name):
    """Bytes of each file of a distribution."""
    paths = {file.locate().resolve() for file in distribution(name).files or ()}
    return {path: path.stat().st_size for path in paths if path.is_file()}


def mebibytes_in(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 2**20
