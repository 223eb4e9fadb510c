"""CHANGELOG.md: the form of Keep a Changelog 1.1.0, one version everywhere, and names that exist."""

from __future__ import annotations

import re
from datetime import date
from itertools import pairwise

import yaml
from packaging.version import Version

import nearharmonic as nh
from nearharmonic import cli
from nearharmonic.integrators import integrators
from support.projects.targets import TARGETS
from support.results.stated_numbers import ROOT

TEXT = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASES = re.findall(r"^## \[(\d\S*)\] - (\S+)$", TEXT, re.MULTILINE)
CITED = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
ADDRESS = CITED["repository-code"]
#: Kinds of changes in the order of the form.
KINDS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]
MOST_WORDS = 1200


def test_newest_release_is_the_version_of_package_and_citation():
    version, day = RELEASES[0]
    assert (version, day) == (CITED["version"], CITED["date-released"].isoformat())
    assert version == nh.__version__


def test_releases_have_dates_and_descend():
    versions, days = zip(*RELEASES, strict=True)
    assert [*versions] == sorted(versions, key=Version, reverse=True)
    assert [*days] == sorted(days, key=date.fromisoformat, reverse=True)
    assert re.findall(r"^## (.+)$", TEXT, re.MULTILINE)[0] == "[Unreleased]"


def test_kinds_of_changes_are_those_of_the_form_in_order():
    for section in re.split(r"^## ", TEXT, flags=re.MULTILINE)[1:]:
        kinds = re.findall(r"^### (.+)$", section, re.MULTILINE)
        assert kinds == [kind for kind in KINDS if kind in kinds], section[:20]


def test_links_at_the_end_compare_neighbouring_releases():
    found = dict(re.findall(r"^\[(\S+)\]: (\S+)$", TEXT, re.MULTILINE))
    names = [version for version, _ in RELEASES]
    expected = {"Unreleased": f"{ADDRESS}/compare/v{names[0]}...HEAD"}
    expected |= {new: f"{ADDRESS}/compare/v{old}...v{new}" for new, old in pairwise(names)}
    assert found == expected | {names[-1]: f"{ADDRESS}/releases/tag/v{names[-1]}"}


def test_changelog_names_what_exists():
    newest = TEXT[TEXT.index(f"## [{nh.__version__}]") : TEXT.index(f"## [{RELEASES[1][0]}]")]
    assert set(re.findall(r"`nh\.(\w+)`", newest)) - {"ModifiedTableau"} <= set(nh.__all__)
    assert set(re.findall(r"`nearharmonic ([a-z-]+)`", newest)) <= set(cli.command_names())
    assert set(re.findall(r"`((?:trained|babs)\w+)`", newest)) <= set(integrators)
    (targets,) = re.findall(r"^- The targets (.+?)\. ", newest, re.MULTILINE)
    assert set(re.findall(r"`(\w+)`", targets)) <= set(TARGETS)
    assert "`beyond` (`sixth_order`)" in newest


def test_changelog_is_short():
    assert len(TEXT.split()) <= MOST_WORDS
