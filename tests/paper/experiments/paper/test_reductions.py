"""Maxima and means over every step, from blocks of steps that were made by hand."""

from __future__ import annotations

import numpy as np
import xarray as xr

from nearharmonic.output.store import described
from nearharmonic_paper.experiments.paper import reductions
from nearharmonic_paper.tasks.reduction import Reductions, exact_sum


def mean_energy_error(blocks):
    return reductions.mean_energy_error(blocks).values


def max_energy_error(blocks):
    return reductions.max_energy_error(blocks).values


def blocks(**changes):
    """Four runs: four steps in blocks of 3 and 1; nine in blocks of 1, 3 and 5; one that is shorter; one that left."""
    nan = np.nan
    values = {
        "block_steps": [[0, 3, 1, 0], [0, 1, 3, 5], [0, 2, 0, 0], [0, 3, 3, 3]],
        "block_mean_energy_error": [[0, 2, 8, nan], [0, 1, 2, 4], [0, 0.5, nan, nan], [0, 1, nan, nan]],
        "block_max_energy_error": [[0, 4, 8, nan], [0, 1, 16, 4], [0, 0.75, nan, nan], [0, 1, nan, nan]],
    }
    notes = described("of |H - H0|/|H0| since the previous sample")
    runs = {name: (("tau_per_stage", "sample"), np.array(rows), notes) for name, rows in (values | changes).items()}
    status = ["ok", "ok", "ok", "diverged"]
    return xr.Dataset(runs | {"steps": ("tau_per_stage", [4, 9, 2, 9]), "status": ("tau_per_stage", status)})


def test_a_mean_over_every_step_weights_blocks_by_their_length():
    """(3 x 2 + 1 x 8) / 4; (1 + 3 x 2 + 5 x 4) / 9; half: sums of powers of two, exact."""
    assert mean_energy_error(blocks()).tolist() == [3.5, 3.0, 0.5, np.inf]


def test_maximum_over_every_step_is_largest_of_blocks():
    assert max_energy_error(blocks()).tolist() == [8.0, 16.0, 0.75, np.inf]


def test_a_mean_is_the_same_bits_in_longer_company():
    random = np.random.default_rng(1)
    for length in (3, 9, 100, 200):
        mean = random.uniform(0, 1, (1, length))
        steps = random.integers(1, 7, (1, length))
        alone = xr.Dataset({
            "block_mean_energy_error": (("tau_per_stage", "sample"), mean, described("mean since the previous sample")),
            "block_steps": (("tau_per_stage", "sample"), steps),
            "steps": ("tau_per_stage", steps.sum(axis=1)),
            "status": ("tau_per_stage", ["ok"]),
        })  # fmt: skip
        padded = alone.pad(sample=(0, 300), constant_values={"block_mean_energy_error": np.nan, "block_steps": 0})
        assert mean_energy_error(alone).item() == mean_energy_error(padded).item()


def test_a_reduction_is_declared_by_the_variables_that_it_needs():
    reduction = Reductions()

    @reduction("q", "status")
    def farthest(runs):
        return abs(runs.q).max("sample").assign_attrs(units="1", long_name="largest |q|")

    @reduction("farthest", over="tau_per_stage")
    def widest(curves):
        return xr.Dataset({"widest_run": curves.farthest.max("tau_per_stage")})

    runs = blocks().assign(q=(("tau_per_stage", "sample"), [[1, -3, 2, 0]] * 4))
    assert reduction.of(blocks()).sizes == {}
    found = reduction.of(runs)
    assert found.farthest.values.tolist() == [3] * 4
    assert found.farthest.attrs["long_name"] == "largest |q|"
    assert set(found.data_vars) == {"farthest"}
    assert reduction.of(found, over="tau_per_stage").widest_run.item() == 3


def test_an_exact_sum_depends_on_no_order_and_skips_nan():
    """1e16 + 1 + ... in any order: partial sums round the ones away, the exact sum is 1e16 + 1000."""
    row = np.concatenate([[1e16], np.ones(1000), [np.nan] * 5])
    orders = [row, row[::-1], np.random.default_rng(1).permutation(row)]
    table = xr.DataArray([*orders, np.full(row.size, np.nan)], dims=("run", "sample"))
    assert exact_sum(table, "sample").values[:3].tolist() == [1e16 + 1000] * 3
    assert np.isnan(exact_sum(table, "sample").values[3])


def test_errors_over_every_step_say_what_they_are_relative_to():
    found = reductions.max_energy_error(blocks())
    assert found.attrs == described("of |H - H0|/|H0| over every step, inf if diverged")
