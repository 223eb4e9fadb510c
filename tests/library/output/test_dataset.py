"""Datasets put together from described variables equal those of xarray's own constructor."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.output.store import assembled, coordinate, variable

VARIABLES = {
    "error": variable("x", np.array([1e-3, np.inf, np.nan]), "relative error"),
    "status": variable("x", np.array(["ok", "diverged", "ok"]), "status"),
    "left": variable("x", np.array([0, 7, 0]), "step"),
    "flags": variable(("x", "y"), np.ones((3, 2), dtype=bool), "flags"),
    "listed": variable("y", [1.5, 2.5], "a list"),
    "scalar": variable((), np.float64(0.25), "a number", "h"),
    "word": variable((), np.array(["ok"])[0], "a word"),
    "whole": variable((), 3, "an integer"),
    "instants": variable("y", np.array(["2015-01-07", "2016-01-07"], dtype="datetime64[D]"), "days"),
}
#: Of dimensions without a coordinate.
COUNTS = {
    "x": variable("x", np.arange(3), "number of the x"),
    "y": variable("y", np.arange(2), "number of the y"),
}
COORDINATES = [
    coordinate("x", np.array([0.3, 0.1, 0.2]), "step size", "h"),
    coordinate("x", np.array([3, 1, 2]), "count"),
    coordinate("x", ["b", "a", "c"], "name"),
    {"t": variable("x", np.array([0.0, 1.0, 2.0]), "time", "h")},
    {},
]


def check_identical(found, expected):
    xr.testing.assert_identical(found, expected)
    assert found.sizes == expected.sizes
    assert set(found.coords) == set(expected.coords)
    assert {k: type(v) for k, v in found.variables.items()} == {k: type(v) for k, v in expected.variables.items()}
    assert {k: v.dtype for k, v in found.variables.items()} == {k: v.dtype for k, v in expected.variables.items()}
    assert {k: v.encoding for k, v in found.variables.items()} == {k: v.encoding for k, v in expected.variables.items()}
    assert set(found.indexes) == set(expected.indexes)
    for name, index in expected.indexes.items():
        assert found.indexes[name].identical(index)
        assert found.xindexes[name].equals(expected.xindexes[name])


@pytest.mark.filterwarnings("ignore:Converting non-nanosecond")
@pytest.mark.parametrize("coordinates", COORDINATES)
def test_an_assembled_dataset_is_the_one_that_xarray_constructs(coordinates):
    found = assembled({**VARIABLES, **coordinates}, list(coordinates), {"system": "sho"})
    counts = {name: count for name, count in COUNTS.items() if name not in coordinates}
    expected = xr.Dataset(VARIABLES, coords=coordinates | counts, attrs={"system": "sho"})
    check_identical(found, expected)
    check_identical(found.isel(x=slice(1, None)), expected.isel(x=slice(1, None)))


def test_variables_of_different_sizes_are_refused():
    with pytest.raises(ValueError, match="conflicting sizes"):
        assembled({"a": variable("x", np.zeros(3), ""), "b": variable("x", np.zeros(2), "")}, [], {})


def test_attributes_of_dataset_and_of_its_variables_are_its_own():
    attributes = {"system": "sho"}
    made = assembled({**VARIABLES, **COORDINATES[0]}, ["x"], attributes)
    made.attrs["system"] = made.error.attrs["units"] = made.x.attrs["units"] = "changed"
    assert attributes == {"system": "sho"}
    assert (VARIABLES["error"][2]["units"], COORDINATES[0]["x"][2]["units"]) == ("1", "h")


def plainly(dataset):
    """Dataset by xarray's constructor, with equal contents."""
    contents = {name: (v.dims, np.array(v.values), dict(v.attrs)) for name, v in dataset.variables.items()}
    coordinates = {name: contents.pop(name) for name in list(dataset.coords)}
    return xr.Dataset(contents, coords=coordinates, attrs=dict(dataset.attrs))


def test_results_of_sweep_and_integrate_are_ordinary_datasets():
    made = nh.sweep("sho", "ruth", [0.5, 0.25, 10.0, 0.5], t_end=20)
    xr.testing.assert_identical(made, plainly(made))
    assert made.indexes["tau"].identical(plainly(made).indexes["tau"])
    assert made.sel(tau=0.25).steps == 80
    assert made.status.values.tolist() == ["ok", "ok", "diverged", "ok"]
    one = nh.integrate("kepler", "ruth", 100, t_end=1000, precision="extended", samples=5)
    xr.testing.assert_identical(one, plainly(one))
    assert set(one.coords) == {"t", *one.sizes}
    assert one.component.values.tolist() == [0, 1]
    assert one.sizes == {"sample": 5, "component": 2, "eccentricity_vector_component": 2, "running_component": 10}


def test_results_of_one_shape_share_neither_values_nor_attributes():
    def one(x):
        return assembled(
            {"t": variable("sample", [x, x], "time"), "q": variable("sample", [x, x], "position")}, ["t"], {}
        )

    first, second = one(1.0), one(2.0)
    first["q"].values[:] = 7.0
    first["t"].values[:] = 7.0
    for name in ("q", "t", "sample"):
        first[name].attrs["note"] = "of the first"
    first = first.assign_coords(sample=[5, 6])
    assert one(2.0).identical(second)
    assert one(1.0).q.values.tolist() == one(1.0).t.values.tolist() == [1.0, 1.0]
    assert one(1.0).sample.values.tolist() == [0, 1]
