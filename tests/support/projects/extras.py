"""Requirements of the package and of its extras, as pyproject.toml declares them."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]


def normal(name):
    """The name of a distribution as PEP 503 compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def of_extra(extra):
    """Requirements of an extra and of the extras that it names, without requirements of the library."""
    every = [Requirement(text) for text in EXTRAS[extra]]
    inner = [name for one in every if one.name == PROJECT["name"] for name in sorted(one.extras)]
    return [one for one in every if one.name != PROJECT["name"]] + [one for name in inner for one in of_extra(name)]


def of_library():
    return [Requirement(text) for text in PROJECT["dependencies"]]


def names_of(requirements):
    return {normal(one.name) for one in requirements}
