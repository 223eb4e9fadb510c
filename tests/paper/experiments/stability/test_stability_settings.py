"""The section of the stress tests: defaults, exact grids, and refusals that name key, value and what is allowed."""

import re
from fractions import Fraction
from pathlib import Path

import pytest
import yaml

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.config import load

ROOT = Path(__file__).parents[4]
SMALL = {
    "name": "small",
    "integrators": ["ruth", "aba864"],
    "systems": {"sho": {"tau_per_stage": {"lowest": 0.01, "highest": 1, "points_per_decade": 5}}},
}


def with_section(**parts):
    return SMALL | {"stability": parts}


def test_config_without_section_gets_ensembles_of_paper_config():
    paper = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    assert load(SMALL).stability == load(paper).stability


def test_the_grid_is_exact_and_ends_where_it_should():
    settings = load(with_section(henon_heiles={"tau_per_stage": {"lowest": 0.1, "spacing": "0.05"}})).stability
    assert settings.henon_heiles.tau_per_stage.grid() == [Fraction(k, 20) for k in range(2, 15)]


def test_energies_may_be_quotients_or_decimals():
    settings = load(with_section(henon_heiles={"energies": ["1/8", 0.1]})).stability
    assert settings.henon_heiles.energies == ("1/8", "1/10")


@pytest.mark.parametrize(
    ("part", "asked", "says"),
    [
        (
            "henon_heiles",
            {"tau_per_stage": {"lowest": 2}},
            "stability.henon_heiles.tau_per_stage.highest = 0.7 is not allowed: a finite number, at least lowest = 2",
        ),
        (
            "henon_heiles",
            {"tau_per_stage": {"spacing": "1e-7"}},
            "stability.henon_heiles.tau_per_stage.spacing = 1e-07 is not allowed: the grid would have 6500001",
        ),
        (
            "henon_heiles",
            {"trajectories": 1_000_000, "t_end": 100_000},
            "stability.henon_heiles.trajectories = 1000000 is not allowed: it would take",
        ),
        ("kepler", {"orbits": 100_000}, "stability.kepler.orbits = 100000 is not allowed: one run may take 1e+09"),
        (
            "kepler",
            {"eccentricities": 10_000, "orbits": 1000, "evaluations_per_orbit": {"points_per_decade": 1}},
            "stability.kepler.orbits = 1000 is not allowed: the states of a method would take",
        ),
        (
            "kepler",
            {"eccentricities": 10_000, "evaluations_per_orbit": {"highest": 5e7}},
            "stability.kepler.eccentricities = 10000 is not allowed: it would take",
        ),
        ("rounding", {"steps": 5000}, "stability.rounding.steps = 5000 is not allowed: at least 20 times"),
        ("rounding", {"ensemble": 100_000}, "stability.rounding.ensemble = 100000 is not allowed: it would take"),
    ],
)
def test_bad_value_error_names_key_value_and_allowed_values(part, asked, says):
    with pytest.raises(NearharmonicError, match=re.escape(says)):
        load(with_section(**{part: asked}))
