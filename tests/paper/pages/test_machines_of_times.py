"""The machine and the versions beside measured times: one machine on all pages, and the versions that are pinned."""

from __future__ import annotations

import re

import pytest

from support.results.stated_numbers import ROOT, flat

PAGES = ("docs/results/timings.md", "docs/results/regularised.md")
PINS = dict(re.findall(r"^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE))


@pytest.mark.parametrize("page", PAGES)
def test_tables_of_times_name_the_machine_of_readme(page):
    (told,) = set(re.findall(r"AMD EPYC at ([\d.]+) GHz \(family (\d+) model (\d+), with ([\w-]+)\)", flat(page)))
    clock, family, model, vectors = told
    assert f"EPYC, {clock} GHz, {vectors}" in flat("README.md")
    assert f"AMD EPYC, family {family} model {model}, {float(clock):.2f} GHz, {vectors}." in flat(
        "docs/results/ranking.md"
    )


def test_versions_of_timed_libraries_are_the_pinned_ones():
    (told,) = re.findall(r"Versions: ((?:[\w-]+ [\d.]*\d(?:, )?)+)", flat(PAGES[0]))
    versions = dict(one.split() for one in told.split(", "))
    assert len(versions) > 6
    del versions["gcc"]  # no package of Python
    assert versions == {name: PINS[name] for name in versions}
    assert f"heyoka {versions['heyoka']}" in flat(PAGES[1])
