"""Tables of the search: errors and ranks of the measured methods, and lines of counts and candidates."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.systems import kepler, sho
from nearharmonic_studies.sixth_order import search as run
from nearharmonic_studies.sixth_order.search import Candidate, Count, Findings, Merit

METHODS = [integrators[name] for name in ("ruth", "leapfrog", "babs7o7h")]
#: Errors of the methods by the stages that tell them apart: ruth the worst, then the best; the last diverges.
ERRORS = {3: [1e-2, 1e-9], 1: [1e-3, 1e-5], 7: [2e-3, np.inf]}


@pytest.fixture
def asked(monkeypatch):
    """Arguments of :func:`sweep`, which returns the errors above."""
    calls = []

    def sweep(system, tableau, taus, *, precision):
        calls.append((system.name, tableau.name, tuple(taus), precision))
        errors = np.array(ERRORS[tableau.stages])
        return xr.Dataset({"max_energy_error": ("tau", errors), "mean_energy_error": ("tau", errors / 4)})

    monkeypatch.setattr(run, "sweep", sweep)
    monkeypatch.setattr(run, "MEASURED", [(kepler.SYSTEM, (30.0, 5.0))])
    return calls


def test_smallest_error_has_rank_one_and_diverged_method_the_last(asked):
    table = run.measured(METHODS)
    assert table.header[-3:] == ("max energy error", "mean energy error", "rank by maximum")
    assert table.rows == [
        ("Sun-Mercury system", 30.0, "Ruth", 4, 1e-2, 0.25e-2, 3),
        ("Sun-Mercury system", 30.0, "Leapfrog", 2, 1e-3, 0.25e-3, 1),
        ("Sun-Mercury system", 30.0, "BABs7o7H", 4, 2e-3, 0.5e-3, 2),
        ("Sun-Mercury system", 5.0, "Ruth", 4, 1e-9, 0.25e-9, 1),
        ("Sun-Mercury system", 5.0, "Leapfrog", 2, 1e-5, 0.25e-5, 2),
        ("Sun-Mercury system", 5.0, "BABs7o7H", 4, np.inf, np.inf, 3),
    ]


def test_measured_error_is_that_of_steps_taken_one_by_one(monkeypatch):
    """The leapfrog with tau = 0.3 from (1, 0) over [0, 500]: 1667 steps, in doubles, which round by 1e-13 of H0."""
    monkeypatch.setattr(run, "MEASURED", [(sho.SYSTEM, (0.3,))])
    ((_, _, _, _, largest, mean, _),) = run.measured([integrators["leapfrog"]]).rows
    q, p, tau, errors = 1.0, 0.0, 500 / 1667, []
    for _ in range(1667):
        p -= tau / 2 * q
        q += tau * p
        p -= tau / 2 * q
        errors.append(abs(q * q + p * p - 1))
    assert largest == pytest.approx(max(errors), rel=1e-9)
    assert mean == pytest.approx(sum(errors) / 1667, rel=1e-9)


def test_lines_of_counts_and_candidates_stand_under_their_names():
    count = Count(stages=8, first="kick", harmonic_order=9, free=1, starts=1000, hits=40, solutions=7)
    merit = Merit(nystrom_error=1e-3, harmonic_error=2e-4, sum_of_absolute_values=3.5, stability_limit=3.1, value=-4.0)
    candidate = Candidate(
        stages=8, first="drift", harmonic_order=9, free=1, unknowns=(0.25, -0.5), hits=12, merit=merit
    )
    table = run.counts(Findings(counts=(count,), candidates=()))
    (row,) = table.rows
    assert dict(zip(table.header, row, strict=True)) == {
        "stages": 8, "first": "kick", "harmonic order": 9, "free parameters": 1, "starts": 1000, "hits": 40,
        "distinct solutions": 7,
    }  # fmt: skip
    table = run.ranking([candidate] * 41)
    assert len(table.rows) == 40
    assert dict(zip(table.header, table.rows[0], strict=True)) == {
        "composition": "ABA", "stages": 8, "harmonic_order": 9, "free": 1, "hits": 12, "nystrom_error": 1e-3,
        "harmonic_error": 2e-4, "sum_of_absolute_values": 3.5, "stability_limit": 3.1, "value": -4.0,
        "unknowns": "0.25 -0.5",
    }  # fmt: skip
    nothing = run.ranking([])
    assert (nothing.header, nothing.rows) == ((), [])
