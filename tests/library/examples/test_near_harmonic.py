"""Anharmonicity of orbits, and the tables of docs/results/examples.md that compare methods by it."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from support.results.page_inputs import benchmark

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/results/examples.md").read_text(encoding="utf-8")


examples = benchmark("near_harmonic")


@pytest.fixture(scope="module")
def systems():
    """The examples."""
    return examples.examples_in((ROOT / "examples").glob("*.py"))


def variation(system, tau, t_end, **start):
    return examples.variation(examples.Orbit(system=system, family="", start=start), tau, t_end)


def table(name):
    """Rows of cells of a table of the page; an empty first cell means the one above."""
    (text,) = re.findall(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", PAGE, flags=re.DOTALL)
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in text.splitlines()[2:]]
    for above, row in pairwise(rows):
        row[0] = row[0] or above[0]
    return rows


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
    monkeypatch.setattr(examples, "FORMED", 5)
    probed = variation(chain, 0.5, 200.0)
    assert probed == pytest.approx(formed, rel=0.25)  # 16 probes at 9 samples


@pytest.mark.slow
@pytest.mark.parametrize("place", [1, 2, 6])
def test_a_row_of_the_page_is_found_again(systems, place):
    orbit = [*examples.families(systems)][place]
    (text,) = (row for row in table("families") if row[:2] == [orbit.family, orbit.amplitude])
    again = examples.table_of_families([examples.measured(orbit)]).splitlines()[-1]
    assert [cell.strip() for cell in again.strip("|").split("|")] == text
