"""The target work_precision: a job that uses all cores, its files, and no cost for other targets."""

import json

import h5py
import pytest

SYSTEMS = ("sho", "henon_heiles", "kepler")


@pytest.mark.slow
def test_times_are_in_a_file_of_their_own(everything):
    """All other files have the same bytes every time."""
    holding = set()
    for path in (everything.folder / "results/tiny").rglob("*.h5"):
        with h5py.File(path) as file:
            names = []
            file.visit(names.append)
            if "cpu" in file.attrs or any("time_" in name for name in names):
                holding.add(path.name)
    assert holding == {"work_precision.h5"}


@pytest.mark.slow
def test_the_file_names_the_machine_and_the_settings(everything):
    with h5py.File(everything.folder / "results/tiny/cubes/work_precision.h5") as file:
        for key in ("cpu", "clock", "pinned_core", "load_average", "measured", "code_digest", "coefficients_digest"):
            assert file.attrs[key]
        assert json.loads(file.attrs["settings"])["methods"] == ["ruth", "babs7o7h", "aba864"]
        assert set(file) == {*SYSTEMS, *(name for name in file if name.endswith("_position"))}
        times = file["kepler/time_trajectory"][:]
        assert (times[..., 0] <= times[..., 2]).sum() == (times[..., 0] > 0).sum() > 0
