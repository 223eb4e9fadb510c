"""docs/results/choices.md: effects of other choices, compared with runs."""

from __future__ import annotations

import re

import numpy as np
import pytest
import yaml

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED
from support.results.stated_numbers import ROOT, shows

PAGE = (ROOT / "docs/results/choices.md").read_text(encoding="utf-8")
METHODS = ("aba104", "abas5o6h", "babps9o7h")
TAU = [36.0, 72.0, 180.0]
PERIOD = 2111.8  # hours


def row(name):
    """The row of the choice that begins with this name."""
    (found,) = re.findall(rf"^\| {re.escape(name)}\b.*$", PAGE, re.MULTILINE)
    return found


def changes(**other):
    """The relative changes of both errors of Figure 5 by other settings, at three step sizes of three methods."""
    found = []
    for name in METHODS:
        one, another = nh.sweep("kepler", name, TAU), nh.sweep("kepler", name, TAU, **other)
        found += [another[v].values / one[v].values - 1 for v in ("max_energy_error", "mean_energy_error")]
    return np.abs(found)


def test_year_of_8760_hours_changes_errors_by_less_than_hundredth():
    assert shows(row("year"), [8760, 5, 1])  # h, of Figure 5, %
    assert 1e-4 < changes(t_end="87600").max() < 0.01


def test_reduced_mass_changes_errors_by_less_than_1e_5():
    assert shows(row("mass"), [1.7e-7, 1e-5])
    GM = float(nh.systems["kepler"].parameters["GM"].value)
    assert 1e-7 < changes(parameters={"GM": str(GM * (1 + 0.3301e24 / 1.9885e30))}).max() < 1e-5


@pytest.mark.parametrize("name", ["aba104", "abas5o6h", "babps8o7h"])
def test_samples_and_interval_change_advance_as_stated(name):
    assert shows(row("regression"), [250, 2000, 0.1, 0.5])
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
    assert shows(row("extended precision"), [1e-19, 64, 1e-26])
    run = nh.sweep("sho", "babps9o7h", [0.0009], precision="extended", t_end="1")
    assert float(run.max_energy_error[0]) < 1e-22


def test_the_other_role_costs_as_much_as_the_page_says():
    assert "ABAs5o6H" in row("operator")
    assert shows(row("operator"), [12, 17])
    tableau = nh.integrators["abas5o6h"]
    for tau_per_stage in (0.02, 0.05, 0.1):
        own, other = (
            float(nh.sweep("henon_heiles", one, [5 * tau_per_stage]).max_energy_error[0])
            for one in (tableau, tableau.role("kick"))
        )
        assert 11.5 < other / own < 17.5


def test_the_methods_of_figure_2_are_those_of_the_page():
    assert all(label in row("methods of Figure 2") for label in ("ABA864", "ABA1064", "Yosh s7o6 A", "four new"))
    config = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    assert config["decomposition"] == ["aba864", "aba1064", "yoshida_s7o6a", *BENCHMARKED[-4:]]
