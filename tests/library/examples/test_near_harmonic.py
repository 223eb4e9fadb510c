"""Anharmonicity of orbits, and the tables of docs/results/examples.md that compare methods by it."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from math import isfinite
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.output.page import filled
from nearharmonic_paper.pages import anharmonicity, examples

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/results/examples.md").read_text(encoding="utf-8")


FILES = sorted(map(str, (ROOT / "examples").glob("*.py")))


@pytest.fixture(scope="module")
def systems():
    """The examples."""
    return anharmonicity.examples_in(FILES)


def variation(system, tau, t_end, **start):
    return anharmonicity.variation(anharmonicity.Orbit(system=system, family="", start=start), tau, t_end)


def table(name):
    """Rows of cells of a table of the page; an empty first cell means the one above."""
    (text,) = re.findall(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", PAGE, flags=re.DOTALL)
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in text.splitlines()[2:]]
    for above, row in pairwise(rows):
        row[0] = row[0] or above[0]
    return rows


def number(cell):
    return float(cell.replace("\N{MINUS SIGN}", "-")) if cell else np.nan


def gains(kind, cost):
    """Gains of the page at a cost by (orbit, amplitude or empty, delta): of the families and the other examples."""
    column = 3 + (25, 50, 100).index(cost) + 3 * (kind == "all")
    found = {(row[0], row[1], number(row[2])): number(row[column]) for row in table("families")}
    names, deltas = [row[0] for row in table("examples")], [row[2] for row in table("examples")]
    twice = ("pendulum", "morse", "quartic_well", "toda_chain", "fput_recurrence")
    for i, row in enumerate(table("examples")):
        delta = next(number(deltas[j]) for j in range(i, -1, -1) if names[j] == row[0] and deltas[j])
        if int(row[1]) == cost and not any(f"/{name}.py" in row[0] for name in twice):
            found[row[0], "", delta] = number(row[8 if kind == "all" else 7])
    return found


def test_the_hessian_of_a_harmonic_system_does_not_vary():
    assert variation(nh.systems["sho"], 0.1, 50.0) == (0, 1)
    masses = nh.System(name="two", V=lambda q: 2 * q[0] ** 2 + q[0] * q[1] + q[1] ** 2, q0=[1, 2], p0=[0, 0], t_end=1,
                       masses=("4", "1/4"))  # fmt: skip
    delta, omega = variation(masses, 0.02, 10.0)
    assert delta < 1e-14  # rounding of the mean over samples
    # det([[4/4 - w2, 1], [1, 2 * 4 - w2]]) = 0
    assert omega == pytest.approx(np.sqrt(4.5 + np.sqrt(4.5**2 - 7)), rel=5e-3)  # rounded to three digits


@pytest.mark.slow
def test_variation_of_pendulum_is_that_of_its_cosine_along_orbit(systems):
    pendulum = systems["pendulum"]
    q = nh.integrate(pendulum, "srkn_a14", 0.01, samples=257, q0=[1.0]).q.values[:, 0]
    delta, omega = variation(pendulum, 0.01, 60.0, q0=[1.0])
    stiffness = np.cos(q)
    assert delta == pytest.approx(stiffness.std() / np.sqrt((stiffness**2).mean()), rel=1e-6)
    assert omega == pytest.approx(np.sqrt(9.80665), rel=5e-3)


def test_circular_kepler_orbit_varies_by_its_rotating_axes():
    circle = replace(
        nh.systems["kepler"], q0=("1", "0"), p0=("0", "1"), parameters={"GM": "1"}, t_end="62.83185307179586"
    )
    delta, omega = variation(circle, 0.01, 20 * np.pi)
    # W = 1 - 3 r r has the norm sqrt(5), and -1/2 is its mean over a turn: norm sqrt(1/2).
    assert delta == pytest.approx(np.sqrt(1 - 0.5 / 5), rel=5e-3)
    assert omega == pytest.approx(np.sqrt(2), rel=5e-3)


@pytest.mark.slow
def test_random_probes_find_the_variation_of_a_large_system(systems, monkeypatch):
    chain = systems["fput_recurrence"]
    formed = variation(chain, 0.5, 200.0)
    monkeypatch.setattr(anharmonicity, "FORMED", 5)
    probed = variation(chain, 0.5, 200.0)
    assert probed == pytest.approx(formed, rel=0.25)  # 16 probes at 9 samples


@pytest.mark.slow
@pytest.mark.parametrize("place", [1, 2, 6])
def test_a_row_of_the_page_is_found_again(systems, place):
    orbit = [*anharmonicity.families(systems)][place]
    (text,) = (row for row in table("families") if row[:2] == [orbit.family, orbit.amplitude])
    again = examples.table_of_families([anharmonicity.measured(orbit)]).splitlines()[-1]
    assert [cell.strip() for cell in again.strip("|").split("|")] == text


@pytest.mark.long
def test_the_tables_of_the_page_are_found_again():
    found, _ = examples.tables(FILES)
    assert filled(PAGE, found) == PAGE


def test_page_on_small_variations_matches_its_tables():
    six, every = gains("six", 50), gains("all", 50)
    small = [gain for (_, _, delta), gain in six.items() if delta <= 0.1 and isfinite(gain)]
    assert len(small) > 15
    assert [min(small), max(small)] == [1.2, 4.1]
    tiny = [gain for (_, _, delta), gain in every.items() if delta <= 0.01 and isfinite(gain)]
    assert f"{np.median(tiny):.2f} decades in the median" in PAGE
    between = [gain for (_, _, delta), gain in every.items() if 0.01 < delta <= 0.1]
    assert np.mean(np.array(between) > 0) > 0.8


def test_page_on_large_variations_matches_its_tables():
    six = {f"{orbit} {amplitude}": gain for (orbit, amplitude, delta), gain in gains("six", 50).items() if delta > 0.5}
    win = [gain for name, gain in six.items() if any(x in name for x in ("Hénon", "double_well", "quadrupole"))]
    lose = [gain for name, gain in six.items() if any(x in name for x in ("outer", "plummer", "hundred", "poincare"))]
    assert [len(win), min(win), max(win)] == [3, 1.2, 1.4]
    assert [len(lose), min(lose), max(lose)] == [4, -0.7, -0.5]
    everyone = [gains("all", cost).items() for cost in (25, 50, 100)]
    assert max(gain for items in everyone for (_, _, delta), gain in items if delta > 0.5) == 0.3


def test_what_page_says_about_families_is_what_its_tables_say():
    six = {key[:2]: gain for key, gain in gains("six", 50).items()}
    assert [six["pendulum", "0.2 rad"], six["pendulum", "1 rad"]] == [2.1, 0]
    alike = [gain for (_, _, delta), gain in gains("six", 50).items() if 0.2 < delta < 0.3]
    assert np.ptp(alike) > 1


def test_best_methods_of_page_are_those_that_it_names():
    rows = [row for row in table("examples") if row[4] != "rounding"]
    new = [nh.integrators[name].label for name in anharmonicity.NEW]
    best = {cost: [row[3] for row in rows if int(row[1]) == cost and row[3] in new] for cost in (25, 50, 100)}
    assert {row[3] for row in rows if "/outer_solar_system.py" in row[0]} == {"ABA104"}
    assert max(set(best[50]), key=best[50].count) == "BABs7o7H"
    for cost in (25, 100):
        assert max(set(best[cost]), key=best[cost].count) == "BAB's9o7H"


def test_the_page_compares_six_families_and_methods_of_others(systems):
    assert set(anharmonicity.SIX) < set(anharmonicity.others())
    assert not set(anharmonicity.NEW) & set(anharmonicity.others())
    assert "six systems from small to large amplitudes" in re.sub(r"\s+", " ", PAGE)
    assert len({orbit.family for orbit in anharmonicity.families(systems)}) == 6
