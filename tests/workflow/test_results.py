"""Results of a figure and, as slow tests, of other targets: contents of files, and the laziness of a second run."""

import json

import h5py
import numpy as np
import pytest
import xarray as xr

from support.projects.targets import SYSTEMS

TINY = ("--configfile", "config/tiny.yaml")


def results(project):
    return project.folder / "results/tiny"


def test_every_variable_of_every_file_has_units_and_a_meaning(after):
    def check(name, member):
        if isinstance(member, h5py.Dataset):
            assert {"units", "long_name"} <= set(member.attrs), name

    for path in results(after).rglob("*.h5"):
        with h5py.File(path) as file:
            file.visititems(check)


@pytest.mark.slow
def test_xarray_finds_a_coordinate_for_each_dimension(after):
    auxiliary = {"label", "exact_label", "kind", "t"}
    for path in results(after).rglob("*.h5"):
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            for node in tree.subtree:
                assert set(node.dims) <= set(node.coords), path
                assert not auxiliary & set(node.data_vars), path


def test_run_files_hold_nothing_derived(after):
    """Variables that follow from others of a file are in the cube alone; other experiments compute errors alone."""
    derived = {"max_energy_error", "mean_energy_error", "observed_order", "perihelion_advance", "evaluations_per_orbit"}
    for path in (path for system in SYSTEMS for path in (results(after) / "runs" / system).rglob("*.h5")):
        with h5py.File(path) as file:
            names = []
            file.visit(names.append)
            assert not derived & {name.rpartition("/")[2] for name in names}, path


def test_every_file_says_where_it_comes_from(after):
    for path in results(after).rglob("*.h5"):
        with h5py.File(path) as file:
            assert json.loads(file.attrs["settings"])
            for key in ("package_version", "code_digest", "coefficients_digest", "numpy_version", "numba_version"):
                assert file.attrs[key]


def test_cube_holds_maximum_over_blocks_of_its_run_files(drawn):
    with xr.open_dataset(results(drawn) / "cubes/henon_heiles.h5", engine="h5netcdf") as cube:
        for shard in (0, 1):
            with h5py.File(results(drawn) / f"runs/henon_heiles/babs7o7h/{shard}.h5") as run:
                for tau, status, blocks in zip(
                    run["tau_per_stage"][:], run["status"][:], run["block_max_energy_error"][:], strict=True
                ):
                    expected = np.inf if status else np.nanmax(blocks)  # 0 is "ok"
                    assert cube.max_energy_error.sel(integrator="babs7o7h", tau_per_stage=tau).item() == expected


def test_nothing_is_left_half_written(after):
    assert list(results(after).rglob(".*")) == []


def test_a_second_run_has_nothing_to_do(drawn):
    assert "Nothing to be done" in drawn.snakemake("fig3", "-j2", *TINY).stdout


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes(breakable):
    names = ["results/tiny/runs/kepler/ruth/0.h5", "results/tiny/cubes/sho_terms.h5"]
    before = [(breakable.folder / name).read_bytes() for name in names]
    assert breakable.snakemake(*names, "--force", "-j2", *TINY).returncode == 0
    assert [(breakable.folder / name).read_bytes() for name in names] == before


def jobs_after_edit(finished, module, more, *arguments):
    """The jobs of a dry run with the text ``more`` at the end of ``module``, which is then mended."""
    path = finished.folder / "src" / module
    original = path.read_text()
    try:
        path.write_text(original + more)
        return finished.jobs(*arguments)
    finally:
        path.write_text(original)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "reruns"),
    [
        (
            "nearharmonic/systems/kepler.py",
            {"compile": 1, "integrate": 4, "reduce": 1, "draw_kepler": 1, "skipped": 1, "decide_claims": 1},
        ),
        (
            "nearharmonic_paper/experiments/paper/run.py",
            {"integrate": 12, "reduce": 3, **{f"draw_{name}": 1 for name in SYSTEMS}, "skipped": 1, "decide_claims": 1},
        ),
        (
            "nearharmonic_paper/experiments/paper/reductions.py",
            {**{f"draw_{name}": 1 for name in SYSTEMS}, "reduce": 3, "skipped": 1, "decide_claims": 1},
        ),
        (
            "nearharmonic_paper/experiments/paper/figures.py",
            {f"draw_{name}": 1 for name in ("sho_terms", "substeps", "substeps_displaced", "kepler")},
        ),
        (
            "nearharmonic/plotting/style.py",
            {f"draw_{name}": 1 for name in (*SYSTEMS, "sho_terms", "substeps", "substeps_displaced")},
        ),
    ],
)
def test_an_edit_runs_what_depends_on_it_and_nothing_else(finished, module, reruns):
    jobs = jobs_after_edit(finished, module, "_EDITED = 1\n", *TINY)
    assert jobs == {**reruns, "draw_henon_heiles_and_kepler": 1, "page": 1, "all": 1}  # the gain is of both systems


@pytest.mark.slow
def test_adding_a_reduction_integrates_nothing(finished):
    added = (
        '\n\n@reduction("q")\ndef largest_position(runs: xr.Dataset) -> xr.DataArray:\n'
        '    return abs(runs.q).max(["sample", "component"]).assign_attrs(described("largest |q|"))\n'
    )
    jobs = jobs_after_edit(finished, "nearharmonic_paper/experiments/paper/reductions.py", added, *TINY)
    shown = {**{f"draw_{name}": 1 for name in SYSTEMS}, "skipped": 1, "decide_claims": 1, "page": 1}
    assert jobs == {"reduce": 3, **shown, "draw_henon_heiles_and_kepler": 1, "all": 1}


@pytest.mark.slow
def test_a_comment_runs_nothing(drawn):
    assert jobs_after_edit(drawn, "nearharmonic/systems/henon_heiles.py", "# a comment\n", "fig3", *TINY) == {}


@pytest.mark.slow
def test_an_edit_of_coefficients_runs_their_method_and_nothing_else(drawn):
    swapped = 'TABLEAUS = tuple(tableau.role("kick") for tableau in TABLEAUS)\n'
    jobs = jobs_after_edit(
        drawn, "nearharmonic/integrators/forest_ruth_1990.py", swapped, "results/tiny/cubes/henon_heiles.h5", *TINY
    )
    assert jobs == {"integrate": 2, "reduce": 1}
