"""Ideas over anharmonicity and step size: systems at all strengths, errors against single runs, best idea."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic_paper.tasks import job
from nearharmonic_studies.trained.problems import random_ensemble, with_exact_oscillators
from nearharmonic_studies.trained.reductions import ideas_reduction, reduce_ideas
from nearharmonic_studies.trained.run import (
    CHARGE_OF_ROTATIONS,
    STRENGTHS,
    STRONGEST,
    WEAKEST,
    ideas_measure,
    log_errors,
    scaled_potentials,
)
from nearharmonic_studies.trained.settings import IDEAS, ProofSettings

METHODS = ("ruth", "blanes_moan_s6o4", "babps8o7h", "babs7o7h", "srkn_b11", "chin_4a")
EXACT = ("aba864",)
SMALL = ProofSettings(systems=12, t_end="15", tau_per_stage=("0.05", "0.1"))
FOUR = np.geomspace(WEAKEST, STRONGEST, 4)


@pytest.fixture(scope="module")
def scaled():
    return scaled_potentials(3, FOUR, 5, 20.0)


def test_strengths_scale_cubic_and_quartic_coefficients_only(scaled):
    one = random_ensemble(2, 3, 5, band=(1.0, 1.0), t_end=20.0)
    for m, strength in enumerate(np.tile(FOUR, 3)):
        row, alone = (each.reshape(-1, 2)[:, 0] for each in (scaled.parameters[m], one.parameters[m // 4]))
        assert (row[:2] == alone[:2]).all()
        assert row[2:] == pytest.approx(strength * alone[2:], rel=1e-15)
        assert (scaled.start[m] == one.start[m // 4]).all()


def declared(whole, squares, rest):
    """One of the potentials as a system that declares its frequencies."""
    w = np.sqrt(squares)
    names = [f"w{i}" for i in range(2)] + [f"c{i}" for i in range(len(rest))]
    values = [*w.tolist(), *rest.tolist()]
    return nh.System(
        name="declared", V=lambda q, w0, w1, *c: whole.system.V(q, w0 * w0, w1 * w1, *c), q0=["0.1", "0.1"],
        p0=["0", "0"], t_end=20, parameters={name: str(Decimal(x)) for name, x in zip(names, values, strict=True)},
        frequencies=("w0", "w1"),
    )  # fmt: skip


@pytest.mark.slow
def test_exact_oscillator_errs_as_single_runs_do_at_equal_cost(scaled):
    taus = np.array([0.05, 0.1])
    found = 10 ** log_errors(with_exact_oscillators(scaled), ["aba864"], taus * CHARGE_OF_ROTATIONS, 0.0)[0]
    for m in (0, 6, 11):
        system = declared(scaled, scaled.parameters[m, :4:2], scaled.parameters[m, 4::2])
        start = scaled.start[m].reshape(4, 2)
        for t, tau in enumerate(taus):
            steps = round(20 / (tau * CHARGE_OF_ROTATIONS * 7))
            run = nh.integrate(
                system, "aba864", Fraction(20, steps), t_end=20, q0=start[0], p0=start[2],
                split="exact_oscillator", summation="plain", samples=2,
            )  # fmt: skip
            # Errors are rounding where the oscillator is all there is.
            assert found[t, m] == pytest.approx(float(run.max_energy_error), rel=0.02, abs=2e-15)


def made(values):
    """Ideas with one method each, whose errors on 6 problems are these at one step size and two strengths."""
    noise = np.linspace(-0.1, 0.1, 6)
    exact, *split = (np.array(row)[None, :, None] + noise * (i + 1) for i, row in enumerate(values.values()))
    over, (first, *others) = ("tau_per_stage", "strength", "problem"), values
    return xr.Dataset(
        {"log_error": (("integrator", *over), split), "exact_log_error": (("exact_integrator", *over), [exact])},
        {
            "integrator": [f"method of {idea}" for idea in others],
            "idea": ("integrator", others),
            "exact_integrator": [f"method of {first}"],
        },
        {"seed": 1},
    )


def test_leader_has_least_mean_error_and_lead_over_second():
    values = {"exact_oscillator": [-9, -4], "harmonic_conditions": [-7, -5], "nystrom": [-6, -5.5], "general": [-5, -5]}
    best = ideas_reduction.of(made(values), over="problem")
    found = {name: entry.values for name, entry in best.assign(ideas_reduction.of(best, over="resample")).items()}
    assert found["leader"].tolist() == [["exact_oscillator", "nystrom"]]
    assert found["lead"][0] == pytest.approx([2, 0.5])
    assert found["leader_split"].tolist() == [["harmonic_conditions", "nystrom"]]
    assert found["lead_split"][0] == pytest.approx([1, 0.5])
    assert found["gain"][:, 0, 0] == pytest.approx([4, np.nan, 2, 1, np.nan, 0], nan_ok=True)
    assert found["best_method"][:, 0, 0].tolist() == [
        "method of exact_oscillator", "", "method of harmonic_conditions", "method of nystrom", "", "method of general",
    ]  # fmt: skip
    low, high = np.moveaxis(found["lead_interval"][0], -1, 0)
    assert (low < found["lead"][0]).all()
    assert (found["lead"][0] < high).all()


def test_exact_gain_is_of_trained_methods_over_published_ones():
    noise = np.linspace(-0.1, 0.1, 6)
    errors = np.array([[-9, -4], [-10, -4.2]])[:, None, :, None] + noise * np.array([1, 2])[:, None, None, None]
    over = ("tau_per_stage", "strength", "problem")
    names = {"integrator": ["one"], "idea": ("integrator", ["general"])}
    names |= {"exact_integrator": ["aba864", "trained_exact_one"]}
    runs = {
        "log_error": (("integrator", *over), errors[:1] + 1),
        "exact_log_error": (("exact_integrator", *over), errors),
    }
    best = ideas_reduction.of(xr.Dataset(runs, names, {"seed": 1}), over="problem")
    found = ideas_reduction.of(best, over="resample")
    assert found.exact_gain.values == pytest.approx(np.array([[1, 0.2]]))
    low, high = found.exact_gain_interval.transpose("bound", ...).values
    assert (low < found.exact_gain).all()
    assert (found.exact_gain < high).all()
    assert found.leader.values.tolist() == [["trained_exact", "trained_exact"]]
    assert found.leader_split.values.tolist() == [["general", "general"]]
    assert best.best_method.sel(idea="exact_oscillator").values.tolist() == [["aba864", "aba864"]]


@pytest.mark.slow
def test_table_has_row_and_equal_numbers_for_each_cell(tmp_path):
    job.write(ideas_measure(METHODS, EXACT, SMALL)["run"], [str(tmp_path / "run.h5")], {})
    made_here = reduce_ideas(METHODS, EXACT, SMALL, str(tmp_path / "run.h5"))
    values = {name: entry.values for name, entry in made_here["cube"].variables.items()}
    rows = made_here["table"].records()
    assert len(rows) == 2 * STRENGTHS
    for n, row in enumerate(rows):
        t, j = divmod(n, STRENGTHS)
        gains = {idea: row[idea] for idea in IDEAS}
        assert (
            row["ahead"] == values["leader"][t, j] == max(IDEAS, key=lambda idea: np.nan_to_num(gains[idea], nan=-99))
        )
        second = sorted(np.nan_to_num(list(gains.values()), nan=-99))[-2]
        assert row["lead"] == pytest.approx(gains[row["ahead"]] - second)
        assert np.isnan(row["trained"])
        assert row["general"] == 0
    assert (np.diff(values["anharmonicity"][:, 1]) > 0).all()
