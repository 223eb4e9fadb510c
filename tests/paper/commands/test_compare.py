"""``nearharmonic compare``: a copy is identical, and each change made to it is found, where it was made."""

from __future__ import annotations

import csv
import json
import math
import re
import shutil

import h5py
import pytest

from nearharmonic.cli import main
from nearharmonic.engine.description import STATUSES
from nearharmonic.output import store
from nearharmonic_paper.record.compare import overlay
from support.cubes.artists import NO_LINE, SOLID, dashes, lines_of
from support.results.finished_results import VERSIONS, write_history
from support.results.result_folder import CLAIMS, config, edited, history_line, write_claims, write_manifest


def compared(capsys, a="paper", b="copy", *more):
    """(exit status, JSON) of a comparison."""
    status = main(["compare", a, b, "--format", "json", *more])
    return status, json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


def differences(capsys, *names):
    status, told = compared(capsys, *names)
    assert (status, told["identical"]) == (1, False)
    return told["differences"]


def change(path, variable, index, value):
    """Set one value in an HDF5 file; returns what stood there."""
    with edited(path) as file:
        before = file[variable][index]
        file[variable][index] = value
        return before


@pytest.mark.slow
def test_a_copy_is_identical(copy, capsys):
    assert compared(capsys)[0] == 0
    assert main(["compare", "paper", "copy"]) == 0
    assert capsys.readouterr().out.splitlines()[0].endswith(": identical")
    assert compared(capsys, "paper", "paper")[1]["differences"] == []


def test_the_least_change_of_a_number_is_found(copy, capsys):
    with h5py.File(copy / "cubes/kepler.h5") as file:
        before = file["perihelion_advance"][0, 1, 0]
    change(copy / "cubes/kepler.h5", "perihelion_advance", (0, 1, 0), math.nextafter(before, math.inf))
    (found,) = differences(capsys)
    assert 0 < found["relative"] < 3e-16
    assert found["unit"] == "rad"
    assert found["at_units"] == {"tau_per_stage": "h"}


@pytest.mark.slow
def test_a_status_that_flipped_is_told_beside_its_infinite_error(copy, capsys):
    change(copy / "cubes/kepler.h5", "status", (0, 0, 3), STATUSES.index("diverged"))
    change(copy / "cubes/kepler.h5", "max_energy_error", (0, 0, 3), math.inf)
    status, number = sorted(differences(capsys), key=lambda found: found["kind"], reverse=True)
    assert (status["kind"], status["a"], status["b"], status["differ"]) == ("status", "ok", "diverged", 1)
    assert status["at"] == number["at"]
    assert (number["relative"], number["b"]) == (None, None)
    assert main(["compare", "paper", "copy", "--format", "csv"]) == 1
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert {row["kind"]: row["relative"] for row in rows} == {"status": "", "number": "inf"}


def test_claims_whose_verdict_changed_come_first(copy, capsys):
    first, other = CLAIMS
    write_claims(copy, [(*first[:3], "fails", *first[4:]), ("new.claim", *other[1:])])
    write_manifest(copy)
    change(copy / "cubes/sho.h5", "tau", (0, 0, 0), 7.0)
    versions = VERSIONS | {"numpy": "2.5.0"}
    write_history(copy, [history_line(8, versions=versions, config=config() | {"samples": 7})])
    found = differences(capsys)
    assert [(d["kind"], d["where"], d["a"], d["b"]) for d in found[:3]] == [
        ("claim", "fig1.order", "holds", "fails"),
        ("missing", "claim fig5.best", "there", "missing"),
        ("missing", "claim new.claim", "missing", "there"),
    ]
    assert [d["kind"] for d in found[3:]] == ["setting", "version", "number"]


@pytest.mark.slow
def test_settings_code_and_versions_are_those_of_newest_successful_run(copy, capsys):
    other = config()
    other["systems"]["kepler"]["t_end"] = "8767"
    del other["systems"]["sho"]
    changed = history_line(
        9, config=other, code_digest="9" * 64, coefficients_digest="8" * 64, versions=VERSIONS | {"numba": "0.69"}
    )
    failed = history_line(10, status="failed", versions={})
    write_history(copy, [history_line(8), changed, failed])
    status, told = compared(capsys)
    assert (status, told["same_numbers"]) == (1, True)
    assert [(d["kind"], d["where"], d["a"], d["b"]) for d in told["differences"]] == [
        ("setting", "config: systems.kepler.t_end", "8766", "8767"),
        ("setting", "config: systems.sho.t_end", "50", None),
        ("setting", "config: systems.sho.tau_per_stage.lowest", 0.002, None),
        ("setting", "config: systems.sho.tau_per_stage.highest", 1.0, None),
        ("code", "newest run", "c" * 10, "9" * 10),
        ("coefficients", "newest run", "d" * 10, "8" * 10),
        ("version", "numba", "0.68.1", "0.69"),
    ]
    assert main(["compare", "paper", "copy"]) == 1
    assert re.search(r": identical numbers; \d+ differences \(.*\) in what made them\n", capsys.readouterr().out)


def test_settings_code_and_versions_in_attributes_of_cube_are_compared(copy, capsys):
    (copy / "history.jsonl").unlink()
    with edited(copy / "cubes/kepler.h5") as file:
        settings = json.loads(file.attrs["settings"])
        settings["sweep"]["samples"] = 51
        file.attrs["settings"] = json.dumps(settings)
        file.attrs["code_digest"] = "7" * 64
    for path in (copy / "cubes").glob("*.h5"):
        with edited(path) as file:
            file.attrs["h5py_version"] = "4.0"
    found = {d["kind"]: (d["where"], d["b"]) for d in differences(capsys)}
    assert found == {
        "setting": ("cubes/kepler.h5: sweep.samples", 51),
        "code": ("cubes/kepler.h5", "7" * 10),
        "version": ("h5py", "4.0"),
    }


def test_what_one_result_lacks_is_told(copy, capsys):
    (copy / "cubes/kepler.h5").unlink()
    shutil.copy(copy / "tables/methods.csv", copy / "tables/more.csv")
    (copy / "tables/claims.json").unlink()
    with edited(copy / "cubes/sho.h5") as file:
        del file["mean_energy_error"]
    told = {d["where"]: (d["kind"], d["a"], d["b"]) for d in differences(capsys)}
    assert told == {
        "tables/claims.json": ("missing", "there", "missing"),
        "cubes/kepler.h5": ("missing", "there", "missing"),
        "cubes/sho.h5: mean_energy_error": ("missing", "there", "missing"),
        "tables/more.csv": ("missing", "missing", "there"),
    }
    assert {(d["a"], d["b"]) for d in differences(capsys, "copy", "paper")} == {
        ("there", "missing"), ("missing", "there"),
    }  # fmt: skip


def test_groups_of_a_cube_are_compared(copy, project, capsys):
    words = {"units": "s", "long_name": "made up"}
    for folder, value, group in ((project, 1.0, "extra"), (copy, 3.0, "other")):
        members = {"tau": (("point",), [value, 2.0], words)}
        store.write(folder / "cubes/timed.h5", {}, {}, groups={"kepler": members, group: members})
    found = {d["where"]: (d["a"], d["b"], d["unit"]) for d in differences(capsys)}
    assert found == {
        "cubes/timed.h5/kepler: tau": (1.0, 3.0, "s"),
        "cubes/timed.h5/extra": ("there", "missing", ""),
        "cubes/timed.h5/other": ("missing", "there", ""),
    }


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["paper", pytest.param("copy", marks=pytest.mark.slow)])
def test_variables_and_files_listed_as_volatile_are_skipped(copy, folder, capsys):
    change(copy / "cubes/kepler.h5", "tau", (0, 0), 1.0)
    change(copy / "cubes/sho.h5", "tau", (0, 0, 0), 1.0)
    assert len(differences(capsys)) == 2
    volatile = [("cubes/kepler.h5", ["tau"]), ("cubes/sho.h5", ["*"]), ("tables/methods.csv", ["seconds"])]
    write_manifest(copy.with_name(folder), volatile=volatile)
    status, told = compared(capsys)
    assert (status, told["left_out"]) == (0, ["cubes/kepler.h5: tau", "cubes/sho.h5", "tables/methods.csv: seconds"])


def test_without_manifest_variable_says_itself_that_it_is_volatile(copy, capsys):
    (copy / "manifest.json").unlink()
    change(copy / "cubes/kepler.h5", "tau", (0, 0), 1.0)
    with edited(copy / "cubes/kepler.h5") as file:
        file["tau"].attrs["volatile"] = "a measured time"
    status, told = compared(capsys)
    assert (status, told["left_out"]) == (0, ["cubes/kepler.h5: tau", "tables/methods.csv: seconds"])


def test_a_damaged_file_is_named(copy, capsys):
    (copy / "tables/claims.json").write_text("[{}]")
    assert main(["compare", "paper", "copy"]) == 2
    assert "results/copy/tables/claims.json is damaged: its bytes differ" in capsys.readouterr().err
    write_manifest(copy)
    assert main(["compare", "paper", "copy"]) == 2
    assert "results/copy/tables/claims.json holds no claims" in capsys.readouterr().err
    write_claims(copy, CLAIMS)
    write_manifest(copy)
    (copy / "cubes/sho.h5").write_bytes(b"no HDF5")
    assert main(["compare", "paper", "copy"]) == 2
    assert "cubes/sho.h5 is truncated or no result file. Make it again" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["paper", "copi"], "unknown result 'copi'. Did you mean 'copy'?"),
        (["paper", "copy", "--figure", "both.gif"], "figure = 'both.gif' is not allowed: a file that ends in .pdf"),
        pytest.param(["paper", "copy", "--figure", "/proc/none/both.png"], "/proc/none", marks=pytest.mark.slow),
        (["paper"], "the following arguments are required: b"),
    ],
)
def test_a_bad_question_is_refused(copy, arguments, says, capsys):
    assert main(["compare", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert err.count("\n") == 1


# --- ``nearharmonic compare --figure``: both results in one figure.


@pytest.mark.slow
def test_the_figure_shows_the_first_solid_and_the_second_dashed(other, project):
    pairs = {}
    for system in ("henon_heiles", "sho"):
        cubes = [store.read(folder / f"cubes/{system}.h5") for folder in (project, other)]
        pairs[system] = [cube.sel(precision="double") for cube in cubes]
    panels = overlay(["paper", "other"], pairs).axes
    assert len(panels) == 4
    for i, (system, cubes) in enumerate(pairs.items()):
        for j, variable in enumerate(("max_energy_error", "mean_energy_error")):
            axes = panels[2 * i + j]
            assert axes.get_title(loc="left").startswith(cubes[0].attrs["system_label"]), system
            seen = 0
            for cube, expected in zip(cubes, ([SOLID, NO_LINE], [(4.0, 2.0)]), strict=True):
                for name in cube.integrator.values:
                    lines = lines_of(axes, cube.tau_per_stage.values, cube[variable].sel(integrator=name).values)
                    looks = [d if d in (SOLID, NO_LINE) else tuple(x / line.get_linewidth() for x in d)
                             for line in lines for d in [dashes(line)]]  # fmt: skip
                    assert looks == expected, name
                    seen += len(lines)
            assert seen == len(axes.get_lines())


@pytest.mark.slow
def test_results_without_a_system_in_common_have_no_figure(copy, capsys):
    shutil.rmtree(copy / "cubes")
    assert main(["compare", "paper", "copy", "--figure", "both.png"]) == 2
    assert "no figure: paper and copy have no system in common" in capsys.readouterr().err


@pytest.mark.slow
def test_the_figure_is_written(copy, tmp_path, capsys):
    place = tmp_path / "sub/both.png"
    assert main(["compare", "paper", "copy", "--figure", str(place), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["figure"] == str(place)
    assert place.stat().st_size > 1000
