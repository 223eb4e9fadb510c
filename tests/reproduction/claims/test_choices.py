"""docs/choices.md: what other choices would change, against runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/choices.md").read_text(encoding="utf-8")
METHODS = ("aba104", "abas5o6h", "babps9o7h")
TAU = [36.0, 72.0, 180.0]
PERIOD = 2111.8  # hours


def row(name):
    """The row of a choice."""
    (found,) = re.findall(rf"^\| {re.escape(name)} \|.*$", PAGE, re.MULTILINE)
    return found


def changes(**other):
    """The relative changes of both errors of Figure 5 by other settings, at three step sizes of three methods."""
    found = []
    for name in METHODS:
        one, another = nh.sweep("kepler", name, TAU), nh.sweep("kepler", name, TAU, **other)
        found += [another[v].values / one[v].values - 1 for v in ("max_energy_error", "mean_energy_error")]
    return np.abs(found)


def test_a_year_of_8760_hours_changes_errors_by_less_than_a_hundredth():
    assert "by less than 1 %" in row("year")
    assert 1e-4 < changes(t_end="87600").max() < 0.01


def test_the_reduced_mass_changes_errors_by_less_than_one_in_a_hundred_thousand():
    assert "1.7 × 10⁻⁷ more, errors by less than 10⁻⁵" in row("mass")
    GM = float(nh.systems["kepler"].parameters["GM"].value)
    assert 1e-7 < changes(parameters={"GM": str(GM * (1 + 0.3301e24 / 1.9885e30))}).max() < 1e-5


@pytest.mark.parametrize("name", ["aba104", "abas5o6h", "babps8o7h"])
def test_samples_and_interval_of_the_regression_change_the_advance_by_as_much_as_is_said(name):
    assert "with 250 or 2000 samples, the advance by less than 0.1 %; over five years, by less than 0.5 %" in row(
        "regression of the perihelion"
    )
    tau = PERIOD / 240 * nh.integrators[name].stages
    rates = {}
    for samples, t_end in ((500, "87660"), (250, "87660"), (2000, "87660"), (500, "43830")):
        run = nh.integrate("kepler", name, tau=tau, samples=samples, t_end=t_end)
        angle = np.unwrap(run.perihelion_angle.values.squeeze())
        rates[samples, t_end] = np.polyfit(run.t.values.squeeze(), angle, 1)[0]
    off = {key: abs(rate / rates[500, "87660"] - 1) for key, rate in rates.items()}
    assert max(off[250, "87660"], off[2000, "87660"]) < 1e-3
    assert 1e-4 < off[500, "43830"] < 5e-3


def test_double_doubles_go_on_where_long_doubles_end():
    """Half a unit of 64 bits is 5e-20; energies of order 1 take a few roundings."""
    assert "end at 10⁻¹⁹ with 64-bit mantissas go on to 10⁻²⁶" in row("extended precision")
    run = nh.sweep("sho", "babps9o7h", [0.0009], precision="extended", t_end="1")
    assert float(run.max_energy_error[0]) < 1e-22


def test_the_other_role_costs_as_much_as_the_page_says():
    assert "errors of ABAs5o6H are 12 to 17 times as large on Hénon-Heiles" in row("operator of a row of coefficients")
    tableau = nh.integrators["abas5o6h"]
    for tau_per_stage in (0.02, 0.05, 0.1):
        own, other = (
            float(nh.sweep("henon_heiles", one, [5 * tau_per_stage]).max_energy_error[0])
            for one in (tableau, tableau.role("kick"))
        )
        assert 11.5 < other / own < 17.5


def test_the_methods_of_figure_2_are_those_of_the_page():
    assert "ABA864, ABA1064, Yosh s7o6 A and the four new methods" in row("methods of Figure 2")
    config = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    assert config["decomposition"] == ["aba864", "aba1064", "yoshida_s7o6a", *BENCHMARKED[-4:]]
