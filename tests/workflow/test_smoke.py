"""The smoke run from end to end: every file of the contract, the laziness of a second run, and broken files named."""

from __future__ import annotations

import csv
import json
from hashlib import sha256

import h5py
import numpy as np
import pytest
import xarray as xr

SMOKE = ("--configfile", "config/smoke.yaml")
FIGURES = ("fig1_sho", "fig2_decomposition", "fig3_henon_heiles", "fig4_perihelion", "fig5_kepler", "fig6_substeps")


@pytest.fixture(scope="module")
def smoke(project):
    """The project after its smoke run, which the tests below only read or mend."""
    done = project.snakemake("-j2", *SMOKE)
    assert done.returncode == 0, done.stdout
    return project


def results(smoke):
    return smoke.folder / "results/smoke"


def test_everything_of_the_contract_is_there(smoke):
    for figure in FIGURES:
        for suffix in ("pdf", "svg", "png"):
            assert (results(smoke) / f"figures/{figure}.{suffix}").stat().st_size > 5000
    made = {str(path.relative_to(results(smoke))) for path in results(smoke).rglob("*.h5")}
    runs = {
        f"runs/{system}/{method}/{shard}.h5"
        for system in ("sho", "henon_heiles", "kepler")
        for method in ("ruth", "yoshida_s7o6a", "babs7o7h")
        for shard in (0, 1)
    }
    assert made == runs | {f"cubes/{name}.h5" for name in ("sho", "henon_heiles", "kepler", "sho_terms")}


def test_every_variable_of_every_file_has_units_and_a_meaning(smoke):
    def check(name, member):
        if isinstance(member, h5py.Dataset) and not member.attrs.get("NAME", b"").startswith(b"This is a netCDF dim"):
            assert {"units", "long_name"} <= set(member.attrs), name

    for path in results(smoke).rglob("*.h5"):
        with h5py.File(path) as file:
            file.visititems(check)


def test_every_file_says_where_it_comes_from(smoke):
    for path in results(smoke).rglob("*.h5"):
        with h5py.File(path) as file:
            assert json.loads(file.attrs["settings"])
            for key in ("package_version", "code_digest", "coefficients_digest", "numpy_version", "numba_version"):
                assert file.attrs[key]


def test_the_cube_holds_the_maximum_over_the_blocks_of_its_run_files(smoke):
    with xr.open_dataset(results(smoke) / "cubes/henon_heiles.h5", engine="h5netcdf") as cube:
        for shard in (0, 1):
            with h5py.File(results(smoke) / f"runs/henon_heiles/babs7o7h/{shard}.h5") as run:
                for tau, status, blocks in zip(
                    run["tau_per_stage"][:], run["status"].asstr()[:], run["block_max_energy_error"][:], strict=True
                ):
                    expected = np.nanmax(blocks) if status == "ok" else np.inf
                    assert cube.max_energy_error.sel(integrator="babs7o7h", tau_per_stage=tau).item() == expected


def test_the_manifest_holds_the_digest_of_every_output(smoke):
    digests = json.loads((results(smoke) / "manifest.json").read_text())["sha256"]
    outputs = {
        str(path.relative_to(results(smoke)))
        for path in results(smoke).rglob("*")
        if path.is_file() and path.name != "manifest.json" and "logs" not in path.parts
    }
    assert set(digests) == outputs
    assert all(sha256((results(smoke) / name).read_bytes()).hexdigest() == digest for name, digest in digests.items())


def test_what_was_left_out_is_a_table_with_reasons(smoke):
    with (results(smoke) / "tables/skipped.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    reasons = {row["reason"] for row in rows}
    assert {"it left its energy surface", "figures 4 and 5 share one pass", "it closed the step before"} <= reasons
    assert all(int(row["runs"]) > 0 for row in rows)


def test_nothing_is_left_half_written(smoke):
    assert list(results(smoke).rglob(".*")) == []


def test_each_job_has_a_log(smoke):
    logs = {path.relative_to(results(smoke) / "logs").parts[0] for path in results(smoke).rglob("*.log")}
    assert {"compile", "integrate", "reduce", "render", "tables"} <= logs


def test_a_second_run_has_nothing_to_do(smoke):
    assert "Nothing to be done" in smoke.snakemake("-j2", *SMOKE).stdout


def test_the_same_run_gives_the_same_bytes(smoke):
    names = ["results/smoke/runs/kepler/ruth/0.h5", "results/smoke/cubes/sho_terms.h5"]
    before = [(smoke.folder / name).read_bytes() for name in names]
    assert smoke.snakemake(*names, "--force", "-j2", *SMOKE).returncode == 0
    assert [(smoke.folder / name).read_bytes() for name in names] == before
    assert smoke.snakemake("-j2", *SMOKE).returncode == 0


def jobs_after_edit(smoke, module, more, *arguments):
    """The jobs of a dry run with the text ``more`` at the end of ``module``, which is then mended."""
    path = smoke.folder / "src/nearharmonic" / module
    original = path.read_text()
    try:
        path.write_text(original + more)
        return smoke.jobs(*arguments)
    finally:
        path.write_text(original)


@pytest.mark.parametrize(
    ("module", "reruns"),
    [
        ("systems/kepler.py", {"compile": 1, "integrate": 6, "reduce": 1, "fig4": 1, "fig5": 1, "skipped": 1}),
        ("integrate.py", {"integrate": 18, "reduce": 3, "fig1": 1, "fig3": 1, "fig4": 1, "fig5": 1, "skipped": 1}),
        ("reduce.py", {"reduce": 3, "decompose": 1, **{f"fig{n}": 1 for n in range(1, 6)}, "skipped": 1}),
        ("render/fig3_henon_heiles.py", {"fig3": 1}),
        ("render/style.py", {f"fig{n}": 1 for n in range(1, 7)}),
    ],
)
def test_an_edit_runs_what_depends_on_it_and_nothing_else(smoke, module, reruns):
    jobs = jobs_after_edit(smoke, module, "# edited\n", *SMOKE)
    assert jobs == {**reruns, "manifest": 1, "all": 1}


def test_an_edit_of_coefficients_runs_their_method_and_nothing_else(smoke):
    swapped = 'TABLEAUS = tuple(tableau.role("kick") for tableau in TABLEAUS)\n'
    jobs = jobs_after_edit(smoke, "integrators/forest_ruth_1990.py", swapped, "results/smoke/cubes/sho.h5", *SMOKE)
    assert jobs == {"integrate": 2, "reduce": 1}


@pytest.mark.parametrize("content", [b"", b"not HDF5", None])
def test_a_broken_result_is_named_with_the_command_that_makes_it_again(smoke, content):
    name = "results/smoke/runs/sho/ruth/0.h5"
    whole = (smoke.folder / name).read_bytes()
    (smoke.folder / name).write_bytes(whole[: len(whole) // 2] if content is None else content)
    broken = smoke.snakemake("-j2", *SMOKE)
    assert broken.returncode == 1
    command = f"snakemake -j2 --configfile config/smoke.yaml --force {name}"
    assert f"{name} is truncated or no HDF5 file. Make it again: {command}" in broken.stdout
    assert smoke.snakemake(*command.split()[1:]).returncode == 0
    assert (smoke.folder / name).read_bytes() == whole
    assert smoke.snakemake("-j2", *SMOKE).returncode == 0
