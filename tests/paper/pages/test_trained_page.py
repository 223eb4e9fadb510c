"""docs/results/trained.md: comparison with runs, and of its text with its tables."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic_paper.pages import trained
from nearharmonic_studies.trained.comparison.contestants import contestants, kind_of
from nearharmonic_studies.trained.comparison.resampling import CONFIDENCE
from nearharmonic_studies.trained.ideas.oscillators import STRONGEST, WEAKEST
from nearharmonic_studies.trained.long_runs.run import BACK, FINE, STARTS, TAU_PER_STAGE
from nearharmonic_studies.trained.problems.named_systems import NAMED, named_ensembles
from nearharmonic_studies.trained.problems.purpose import CHARGE, CHARGE_OF_ORBITS, ECCENTRICITIES
from nearharmonic_studies.trained.proof.reductions import gains
from nearharmonic_studies.trained.proof.run import log_errors
from nearharmonic_studies.trained.proof.settings import ORBITS, ProofSettings
from support.results.stated_numbers import ROOT, states

PLACE = "docs/results/trained.md"
PAGE = (ROOT / PLACE).read_text(encoding="utf-8")
SETTINGS = ProofSettings()
NUMBER = r"[+\N{MINUS SIGN}]\d+\.\d\d"
pytestmark = pytest.mark.skipif(
    not any(name.startswith("trained_") for name in nh.integrators.registered), reason="no trained method is registered"
)


def rows(part):
    """The rows of a table of the page, without its header."""
    (text,) = re.findall(rf"<!-- {part} -->\n(.*?)\n<!-- end -->", PAGE, flags=re.DOTALL)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()][2:]


def value(cell):
    (found,) = re.findall(NUMBER, cell)
    return float(found.replace("\N{MINUS SIGN}", "-"))


def header(part):
    (text,) = re.findall(rf"<!-- {part} -->\n(.*?)\n", PAGE)
    return [cell.strip() for cell in text.strip("|").split("|")]


def test_page_methods_are_registered_and_all_registered_have_row():
    named = {row[0].strip("`") for row in rows("windows")}
    assert named == {name for name in contestants() if kind_of(name) == "trained"}
    assert set(re.findall(r"\btrained_[a-z0-9_]+", "".join(map(str, rows("widest") + rows("orbits"))))) <= named


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (ECCENTRICITIES, ("of eccentricities", "ten periods each")),
        ([float(SETTINGS.t_end)], ("radians of the fastest", "runs cover")),
        ([100 * CONFIDENCE], ("by resampling the problems",)),
        ([CHARGE], ("charged for their gradients", "most systems")),
        ([CHARGE_OF_ORBITS], ("charged for their gradients", "Kepler orbits")),
        ([WEAKEST, STRONGEST], ("except for strengths from",)),
        ([SETTINGS.steps, TAU_PER_STAGE, STARTS], ("The runs have", "starts each")),
        ([float(SETTINGS.steps * BACK)], ("The way back", "steps forwards and backwards")),
        ([FINE], ("in double-double with the same coefficients",)),
    ],
)
def test_settings_of_the_comparison_are_those_of_the_page(wanted, words):
    assert ORBITS == 10
    assert states(PLACE, wanted, *words)


def test_exact_oscillator_is_ahead_up_to_the_stated_anharmonicity():
    (stated,) = re.findall(r"From τ/s = 0.03 on, the exactly solved oscillator is ahead up to δ = (\S+) or more", PAGE)
    end = re.compile(r"oscillator solved exactly(?: \(trained\))? ([\d.]+)")
    found = {float(tau): max(map(float, end.findall(leaders)), default=0) for tau, leaders, _ in rows("ideas")}
    assert min(end for tau, end in found.items() if tau >= 0.03) == float(stated)


@pytest.mark.slow
@pytest.mark.parametrize("label", [pytest.param("Morse", marks=pytest.mark.long), "Hénon-Heiles"])
def test_gains_on_named_systems_are_those_of_runs(label):
    settings, names = ProofSettings(), contestants()
    taus = [float(tau) for tau in settings.tau_per_stage]
    (ensemble,) = (
        one for one in named_ensembles(settings.systems, settings.seed, float(settings.t_end)) if one.name == label
    )
    logs = log_errors(ensemble, names, np.array(taus), CHARGE)
    runs = xr.Dataset(
        {"log_error": (("ensemble", "integrator", "point", "problem"), [logs])},
        {"ensemble": [label], "integrator": list(names), "kind": ("integrator", list(map(kind_of, names)))},
        {"seed": settings.seed},
    )
    found = gains(runs).isel(ensemble=0)
    (row,) = (row for row in rows("gains") if row[0] == label)
    assert list(map(float, header("gains")[1:])) == sorted(taus)
    # Energy errors differ in the last digits between processors.
    assert [value(cell) for cell in row[1:]] == pytest.approx(found.gain.values.tolist(), abs=0.03)
    for cell, (low, high) in zip(row[1:], found.gain_interval.values, strict=True):
        if min(abs(low), abs(high)) > 0.03:
            assert cell.startswith("**") == (low > 0), cell
            assert cell.startswith("(") == (low < 0 < high), cell


def test_mean_is_that_of_rows_and_every_ensemble_has_one():
    *each, mean = rows("gains")
    assert len(each) == 8 + len(NAMED)
    for column in range(1, len(mean)):
        assert value(mean[column]) == pytest.approx(np.mean([value(row[column]) for row in each]), abs=0.011)


def test_index_of_results_says_what_the_tables_say():
    text = re.sub(r"\s+", " ", (ROOT / "docs/results/index.md").read_text(encoding="utf-8"))
    taus = list(map(float, header("gains")[1:]))
    widest = [row[1:] for row in rows("gains") if row[0].endswith("0.01 to 0.5")]
    assert len(widest) == 2
    of_potentials = [value(cell) for row in widest for tau, cell in zip(taus, row, strict=True) if 0.02 <= tau <= 0.2]
    of_orbits = [value(row[5].partition("(")[0]) for row in rows("orbits")]
    ranges = (
        r"`trained_\*` have errors (\S+) to (\S+) decades smaller",
        r"Kepler orbits their errors are (\S+) to (\S+) decades smaller",
    )
    for stated, found in zip(ranges, (of_potentials, of_orbits), strict=True):
        least, most = map(float, re.search(stated, text).groups())
        assert least <= min(found) < least + 0.1
        assert most - 0.05 <= max(found) < most + 0.05


def test_every_loss_of_table_of_gains_stands_among_losses():
    taus, told = header("gains")[1:], rows("losses")
    for row in rows("gains")[:-1]:
        behind = [float(tau) for tau, cell in zip(taus, row[1:], strict=True) if cell.startswith("\N{MINUS SIGN}")]
        inside = [list(map(float, loss[1].split(" to "))) for loss in told if loss[0] == row[0]]
        assert all(any(ends[0] <= tau <= ends[-1] for ends in inside) for tau in behind), row
        assert bool(inside) == bool(behind), row


def test_what_page_says_of_ideas_is_what_its_table_says():
    """The smallest steps apart, at which the errors of small anharmonicity are rounding."""
    for tau, every, split in rows("ideas"):
        if 0.03 <= float(tau) <= 0.2:
            assert every.startswith("oscillator solved exactly"), tau
            assert "trained" in every, tau
        if 0.02 <= float(tau) <= 0.25:
            assert split.startswith("harmonic conditions") is (0.05 <= float(tau) <= 0.12), tau
            assert "trained" in split, tau


def test_long_runs_show_no_drift_as_the_page_says():
    for row in rows("long"):
        assert abs(float(row[4])) <= 1.2 * float(row[5]), row  # both are rounded to one digit


def test_each_view_says_what_its_table_has():
    assert trained.signed(-0.126) == "\N{MINUS SIGN}0.13"
    assert trained.gain_cell({"gain": 0.5, "verdict": "ahead"}) == "**+0.50**"
    assert trained.gain_cell({"gain": 0.0, "verdict": "even"}) == "(+0.00)"
    leaders = [("trained", 0.1), ("trained", 0.2), ("general", 0.4)]
    found = [{"ahead": name, "anharmonicity": end} for name, end in leaders]
    assert trained.sequence(found, "ahead") == "trained 0.2, general 0.4"
