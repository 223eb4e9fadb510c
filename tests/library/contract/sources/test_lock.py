"""Locked requirements: the pinned versions, each with digests, and all that the package asks for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from support.projects.extras import of_extra, of_library

ROOT = Path(__file__).parents[4]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
#: Packages of operating systems that constraints.txt was not made on.
ELSEWHERE = {"colorama", "pyreadline3"}


def pins(text):
    """Versions by name in a file of requirements or constraints."""
    found = re.findall(r"^([\w.-]+)==([\w.]+)", text, re.MULTILINE)
    return {canonicalize_name(name): version for name, version in found}


def asked():
    """Requirements of the package, and of the extras that a machine needs for the workflow and its tests."""
    every = (*of_library(), *of_extra("cluster"), *of_extra("test"))
    return list({str(one): one for one in every}.values())


def test_lock_has_versions_of_constraints():
    constraints = pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))
    locked = pins(LOCK)
    assert {name: constraints.get(name) for name in locked.keys() - ELSEWHERE} == {
        name: version for name, version in locked.items() if name not in ELSEWHERE
    }


@pytest.mark.parametrize("requirement", asked(), ids=str)
def test_lock_covers_requirement_of_package(requirement):
    assert requirement.specifier.contains(pins(LOCK)[canonicalize_name(requirement.name)])


def test_each_locked_version_has_digests_and_no_address():
    for block in re.split(r"\n(?=\w)", LOCK)[1:]:
        assert re.search(r"--hash=sha256:[0-9a-f]{64}\b", block), block.splitlines()[0]
    assert "://" not in LOCK
