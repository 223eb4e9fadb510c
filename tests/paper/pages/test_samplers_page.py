"""Statements of docs/results/samplers.md, against the tables on the page."""

from __future__ import annotations

import re
from pathlib import Path

from nearharmonic.integrators import integrators

PAGE = (Path(__file__).parents[3] / "docs/results/samplers.md").read_text(encoding="utf-8")


def rows_of(mark):
    """Cells of a table of the page, without emphasis, by row; its head is first."""
    (table,) = re.findall(rf"<!-- {mark} -->\n(.*?)\n<!-- end -->", PAGE, flags=re.DOTALL)
    rows = [[cell.strip().strip("*") for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return [row for row in rows if not set("".join(row)) <= set(":- ")]


def first(cell):
    """The number with which a cell begins."""
    return float(re.match(r"[\d.]+", cell)[0])


def test_bcss_4_leads_the_published_methods_on_all_gaussians():
    _, *rows = rows_of("gaussians")
    known = {row[0]: row[1:] for row in rows if not row[0].startswith("searched")}
    columns = range(len(known["BCSS 4"]))
    assert [max(known, key=lambda name: first(known[name][k])) for k in columns] == ["BCSS 4"] * len(columns)


def test_bcss_leads_on_targets_of_a_thousand_dimensions():
    leaders = {row[0]: row[1] for row in rows_of("trained")}
    assert {leaders[name][:4] for name in leaders if "1024" in name or "32 × 32" in name} == {"BCSS"}


def test_no_trained_method_gains_what_registration_requires():
    """The lower end of the interval of a gain on targets of another kind than those of training is below 1.15."""
    unseen = [row for row in rows_of("trained")[1:] if "oscillators" not in row[0] and "1024" not in row[0]]
    lower = [first(cell.partition("(")[2]) for row in unseen for cell in row[2:]]
    assert len(lower) == 4 * 3
    assert max(lower) < 1.15
    assert not [name for name in integrators if name.startswith("searched")]


def test_leapfrog_is_enough_where_the_page_says_so():
    header, *rows = rows_of("targets")
    for name in ("eight schools", "Gaussian process"):
        (k,) = (k for k, cell in enumerate(header) if cell.startswith(name))
        assert all(first(row[k].partition("(")[2]) <= 1 for row in rows if not row[0].startswith("searched"))


def test_bcss_4_leads_leapfrog_with_mclmc_and_not_nuts():
    header, *rows = rows_of("libraries")
    for row in (row for row in rows if len(row) == len(header)):  # versions follow the table
        cells = dict(zip(header, row, strict=True))
        if cells["sampler"].startswith("MCLMC"):
            assert first(cells["BCSS 4"].partition("(")[2]) > 1
        if cells["sampler"].startswith("NUTS") and cells["target"] in ("Gaussian process", "regression"):
            assert all(first(cells[name].partition(" to ")[2]) < 1 for name in ("BCSS 3", "BCSS 4"))


def test_training_for_one_strength_gains_little_more():
    """And the methods for the three strengths lose at b = 0."""
    together = {row[0].rpartition("b = ")[2]: row for row in rows_of("trained") if "oscillators" in row[0]}
    _, *alone = rows_of("alone")
    for k, row in enumerate(alone[1:], 2):
        strength = row[0].rpartition("b = ")[2]
        assert first(row[k]) - first(together[strength][3]) <= 0.02
        assert first(row[1]) < 1
    assert all(first(cell) < 1 for cell in together["0"][2:])
