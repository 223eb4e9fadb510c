"""``nearharmonic runs``: cells of the cubes, compared with xarray: selection, sorting and limits."""

from __future__ import annotations

import csv
import io
import math
import shutil

import numpy as np
import pytest
import xarray as xr

from nearharmonic.cli import main
from nearharmonic.output import store
from nearharmonic_paper.record import manifest
from support.results.result_folder import edited

COLUMNS = [
    "system", "integrator", "precision", "tau", "tau_per_stage", "steps", "evaluations", "max_energy_error",
    "mean_energy_error", "status", "diverged_at", "label",
]  # fmt: skip
KEPLER = [
    "evaluations_per_orbit", "perihelion_advance", "perihelion_advance_halves", "perihelion_advance_interval",
    "perihelion_advance_linearity",
]  # fmt: skip


def told(capsys, *arguments):
    assert main(["runs", *arguments, "--format", "csv"]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def cells(folder, system):
    """(integrator, precision, tau_per_stage) -> the numbers of each cell that was run, by h5netcdf and xarray."""
    with xr.open_dataset(folder / f"cubes/{system}.h5", engine="h5netcdf") as opened:
        cube = opened.load()
    words = cube.status.attrs["flag_meanings"].split()
    found = {}
    for precision in cube.precision.values:
        for name in cube.integrator.values:
            for tau in cube.tau_per_stage.values:
                cell = cube.sel(precision=precision, integrator=name, tau_per_stage=tau)
                row = {key: cell[key].item() for key in cell.variables}
                row["status"] = words[row["status"]]
                if row["status"] != "skipped":
                    found[str(name), str(precision), float(tau)] = row
    return found


@pytest.mark.slow
def test_every_cell_that_was_run_is_row_with_its_numbers(project, capsys):
    rows = told(capsys, "paper")
    assert list(rows[0]) == [*COLUMNS, *KEPLER]
    assert [row["system"] for row in rows] == sorted(row["system"] for row in rows)
    for system in ("henon_heiles", "kepler", "sho"):
        expected = cells(project, system)
        mine = [row for row in rows if row["system"] == system]
        keys = [(row["integrator"], row["precision"], float(row["tau_per_stage"])) for row in mine]
        assert keys == sorted(expected)
        for key, row in zip(keys, mine, strict=True):
            for name in (*COLUMNS[3:], *(KEPLER if system == "kepler" else ())):
                value = expected[key][name]
                assert row[name] == str(value), name
    assert {row["precision"] for row in rows} == {"double", "extended"}
    assert {row["status"] for row in rows} == {"ok", "diverged"}


@pytest.mark.slow
def test_a_condition_chooses_rows(project, capsys):
    every = told(capsys, "paper")
    chosen = told(capsys, "paper", "--where", "max_energy_error < 1e-6 and status == 'ok' and integrator in ['ruth']")
    assert chosen == [row for row in every if float(row["max_energy_error"]) < 1e-6 and row["integrator"] == "ruth"]
    assert 0 < len(chosen) < len(every)
    diverged = told(capsys, "paper", "--where", "max_energy_error == inf")
    assert {row["status"] for row in diverged} == {"diverged"}
    assert told(capsys, "paper", "--where", "steps < 0") == []


@pytest.mark.slow
def test_rows_are_sorted_with_nan_last_and_stable_ties(project, capsys):
    every = told(capsys, "paper")
    for key, sign in (("perihelion_advance", 1), ("-perihelion_advance", -1), ("-steps", -1)):
        values = [float(row[key.removeprefix("-")]) for row in told(capsys, "paper", "--sort", key)]
        finite = [value for value in values if not math.isnan(value)]
        assert finite == sorted(finite, key=lambda value, sign=sign: sign * value)
        assert all(math.isnan(value) for value in values[len(finite) :])
    by_status = sorted(every, key=lambda row: row["status"], reverse=True)
    assert [r["status"] for r in by_status[:1]] == ["ok"]
    assert told(capsys, "paper", "--sort", "-status") == by_status  # sorted() is stable, in reverse as well


def test_columns_and_limit_cut_table_and_units_are_told(project, capsys):
    arguments = ["runs", "paper", "--columns", "system, tau,perihelion_advance", "--sort", "-tau", "--limit", "2"]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["system", "tau", "perihelion_advance"]
    assert lines[1].split()[:2] == ["kepler", "876.6"]
    assert lines[-2:] == ["49 of 49 runs, 2 shown", "kepler: tau in h, perihelion_advance in rad"]
    assert told(capsys, "paper", "--limit", "0") == []


def test_several_results_have_a_column_that_names_them(project, capsys):
    shutil.copytree(project, project.with_name("copy"))
    rows = told(capsys, "paper", "copy", "--sort", "-tau")
    assert list(rows[0]) == ["result", *COLUMNS, *KEPLER]
    assert [row["result"] for row in rows[:2]] == ["paper", "copy"]
    assert len(rows) == 2 * len(told(capsys, "paper"))


def test_a_cube_that_holds_no_single_runs_is_left_out(project, capsys):
    before = told(capsys, "paper")
    ratio = {"relative_error": (("amplitude",), np.ones(3), {"units": "1", "long_name": "ratio"})}
    store.write(project / "cubes/kinetic_energy.h5", ratio, {"system": "relativistic_oscillator"})
    assert told(capsys, "paper") == before


def test_system_that_the_config_lacks_is_named_in_last_line(project, capsys):
    every = told(capsys, "paper")
    manifest.write(project, manifest.read(project)["files"].keys() - {"cubes/kepler.h5"})
    assert told(capsys, "paper") == [
        {key: cell for key, cell in row.items() if key not in KEPLER} for row in every if row["system"] != "kepler"
    ]
    assert main(["runs", "paper", "--limit", "1"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "Left out: kepler, which the config of paper no longer has"


def test_cube_of_system_that_lacks_variable_is_named(project, capsys):
    with edited(project / "cubes/sho.h5") as file:
        del file["steps"]
    assert main(["runs", "paper"]) == 2
    assert "cubes/sho.h5 has no steps. Make it again: snakemake" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--columns", "system,errr"], "unknown column 'errr'."),
        (["--sort", "-max_energy_eror"], "unknown column 'max_energy_eror'. Did you mean 'max_energy_error'?"),
        (["--where", "stats == 'ok'"], "unknown column 'stats'. Did you mean 'status'?"),
        (["--where", "status = 'ok'"], "cannot be read at character 8"),
        (["--limit", "few"], "limit = 'few' is not allowed: an integer of at least 0"),
        (["--limit=-1"], "limit = '-1' is not allowed"),
    ],
)
def test_a_bad_question_is_refused(project, arguments, says, capsys):
    assert main(["runs", "paper", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err


def test_results_without_cubes_have_no_runs(project, capsys):
    shutil.rmtree(project / "cubes")
    assert told(capsys, "paper", "--where", "max_energy_error < 1 and status == 'ok'", "--sort", "tau") == []
