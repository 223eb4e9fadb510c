"""Verification: every flipped bit, every missing and extra file, other code and other coefficients."""

from __future__ import annotations

import json
import random

import pytest

from nearharmonic.output.atomic import sealed
from nearharmonic_paper.record import history, manifest, verify
from nearharmonic_paper.record.verify import faults
from nearharmonic_paper.tasks.provenance import Receipt, task

TASK = task("nearharmonic_paper.experiments.paper.run:integrate", system="sho", integrator="ruth")
FILES = {
    "runs/sho/ruth/0.h5": b"trajectory",
    "cubes/sho.h5": b"numbers",
    "tables/t.csv": b"a,b\n1,2\n",
    "figures/f.png": b"\x89PNG",
    "report.html": b"<html></html>",
}


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results/smoke"
    receipt = Receipt("results/smoke/logs/a.log")
    for name, content in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
        receipt.add([f"results/smoke/{name}"], TASK)
    receipt.write()
    manifest.write(folder)
    history.append(folder, {"id": "0", "start": "2026-01-01T00:00:00.000Z", "config": {}, "status": "ok"})
    return folder


def test_untouched_results_have_no_fault(results):
    assert faults(results) == []


@pytest.mark.parametrize("name", FILES)
def test_every_single_flipped_bit_is_found(results, name):
    for bit in range(8 * len(FILES[name])):
        damaged = bytearray(FILES[name])
        damaged[bit // 8] ^= 1 << bit % 8
        (results / name).write_bytes(damaged)
        (found,) = faults(results)
        assert (found.file, found.says) == (name, "is damaged: its bytes differ from what its job wrote")
        assert found.mend.startswith("Make it again: snakemake -j2 --configfile config/smoke.yaml --force ")
        assert found.mend.endswith(name)


@pytest.mark.slow
def test_every_flipped_bit_of_the_manifest_is_found(results):
    """But for those between its words, where one blank is as good as another."""
    whole = (results / "manifest.json").read_bytes()
    before = json.loads(whole)
    for bit in random.Random(1).sample(range(8 * len(whole)), 1000):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        (results / "manifest.json").write_bytes(damaged)
        found = faults(results)
        assert [fault.file for fault in found] == ["manifest.json"] or json.loads(damaged) == before


def test_a_missing_file_is_found(results):
    (results / "cubes/sho.h5").unlink()
    assert [(fault.file, fault.says) for fault in faults(results)] == [("cubes/sho.h5", "is missing")]


def test_an_extra_file_is_found(results):
    (results / "cubes/mine.h5").write_bytes(b"?")
    (found,) = faults(results)
    assert (found.file, found.says, found.mend) == ("cubes/mine.h5", "is extra: no job made it", "Move it elsewhere")


def test_a_missing_manifest_is_a_fault(results):
    (results / "manifest.json").unlink()
    (found,) = faults(results)
    assert (found.file, found.says) == ("manifest.json", "does not exist")
    assert found.mend == "Make it again: snakemake -j2 --configfile config/smoke.yaml --force " + str(
        results / "report.html"
    )


def edit(results, **changes):
    place = results / "manifest.json"
    document = manifest.read(results)
    for entry in document["files"].values():
        entry.update(changes)
    place.write_text(json.dumps(sealed(document)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"code": "0" * 64},
            "was made with other code (and 4 more), by nearharmonic_paper.experiments.paper.run:integrate",
        ),
        ({"coefficients": "0" * 64}, "was made with other coefficients (and 4 more), by"),
        ({"code": "0", "coefficients": "0"}, "was made with other code and coefficients (and 4 more), by"),
        ({"integrators": ["leapfrog"]}, "was made with other coefficients (and 4 more), by"),
        ({"systems": ["kepler"]}, "was made with other code (and 4 more), by"),
        (
            {"systems": ["no_more"]},
            "was made with other code, part of which is missing here (unknown system 'no_more'",
        ),
        ({"function": "gone.run:measure"}, "was made with other code, part of which is missing here (no module"),
    ],
)
def test_other_code_and_coefficients_are_reported_once_per_function(results, changes, says):
    edit(results, **changes)
    (found,) = faults(results)
    assert found.says.startswith(says)
    assert found.mend == "Make it again: snakemake -j2 --configfile config/smoke.yaml"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "target"),
    [
        ("nearharmonic_paper.experiments.derivation.run:derive", " -- derive"),
        ("nearharmonic_paper.experiments.paper.reductions:reduce", ""),
        ("nearharmonic_paper.claims.table:decided", ""),
    ],
)
def test_the_command_names_the_target_that_the_function_belongs_to(results, function, target):
    edit(results, function=function, code="0")
    (found,) = faults(results)
    assert found.mend == f"Make it again: snakemake -j2 --configfile config/smoke.yaml{target}"


def test_command_has_config_that_results_were_made_with(results):
    (results / "cubes/sho.h5").unlink()
    manifest.write(results, makeable=FILES, configfiles=["elsewhere/my.yaml"])
    assert faults(results)[0].mend.startswith("Make it again: snakemake -j2 --configfile elsewhere/my.yaml --force ")
    manifest.write(results, makeable=FILES, configfiles=["config/config.yaml"])
    assert faults(results)[0].mend.startswith("Make it again: snakemake -j2 --force ")


def test_faults_are_told_in_order_in_which_they_are_mended(results):
    for name in FILES:
        (results / name).write_bytes(b"?")
    assert [fault.file.partition("/")[0] for fault in faults(results)] == [
        "runs", "cubes", "figures", "tables", "report.html",
    ]  # fmt: skip


def test_file_of_former_config_is_fault_until_it_is_gone(results):
    rest = [name for name in FILES if name != "runs/sho/ruth/0.h5"]
    manifest.write(results, makeable=rest)
    (found,) = faults(results)
    assert (found.file, found.says) == ("runs/sho/ruth/0.h5", "is of a former config: no job makes it now")
    assert found.mend == "Move it elsewhere"
    (results / "runs/sho/ruth/0.h5").unlink()
    assert faults(results) == []


def test_files_of_killed_run_are_not_damaged_or_extra(results):
    (results / "cubes/sho.h5").write_bytes(b"newer")
    (results / "cubes/more.h5").write_bytes(b"more")
    receipt = Receipt("results/smoke/logs/b.log")
    receipt.add(["results/smoke/cubes/sho.h5", "results/smoke/cubes/more.h5"], TASK)
    receipt.write()
    assert {fault.file: fault.says for fault in faults(results)} == dict.fromkeys(
        ("cubes/more.h5", "cubes/sho.h5"), "was made by a run that has not ended, or was killed"
    )


def test_file_without_record_is_made_again(results):
    (results / "logs/a.json").unlink()
    (results / "manifest.json").unlink()
    manifest.write(results, makeable=FILES)
    assert {fault.says for fault in faults(results)} == {"has lost its record"}
    assert all(fault.mend.startswith("Make it again: ") for fault in faults(results))


def test_a_file_that_was_made_from_another_is_found(results):
    """As after a run with other settings that was cut short: its parts are whole, but they do not belong together."""
    receipt = Receipt("results/smoke/logs/b.log", ["results/smoke/runs/sho/ruth/0.h5"])
    receipt.add(["results/smoke/cubes/sho.h5"], TASK)
    receipt.write()
    manifest.write(results)
    assert faults(results) == []
    (results / "runs/sho/ruth/0.h5").write_bytes(b"another")
    receipt = Receipt("results/smoke/logs/a.log")
    receipt.add([f"results/smoke/{name}" for name in FILES if name != "cubes/sho.h5"], TASK)
    receipt.write()
    manifest.write(results)
    (found,) = faults(results)
    assert (found.file, found.says) == ("cubes/sho.h5", "was made from another runs/sho/ruth/0.h5")
    assert found.mend.startswith("Bring it up to date: snakemake -j2 --configfile config/smoke.yaml ")


def test_files_of_runs_with_another_config_are_counted(results):
    def run(name, config, status="ok", made=()):
        told = {"start": f"2026-01-01T00:00:0{name}.000Z", "status": status, "config": {}, "made": list(made)}
        history.append(results, {"id": name, "config_digest": config, **told})

    assert verify.extent(results)[-1] == 0
    run("1", "former", made=FILES)
    run("2", "present", made=set(FILES) - {"cubes/sho.h5"})
    assert verify.extent(results)[-1] == 1
    run("3", "failed", status="failed")
    assert verify.extent(results)[-1] == 1


def test_a_changed_line_of_the_history_is_named(results):
    place = results / "history.jsonl"
    place.write_text(place.read_text().replace('"ok"', '"no"'))
    (found,) = faults(results)
    assert (found.file, found.says) == ("history.jsonl", "line 1 is damaged: its seal does not match")


def test_a_changed_receipt_is_named(results):
    place = results / "logs/a.json"
    place.write_text(place.read_text().replace('"size": 10', '"size": 11'))
    (found,) = faults(results)
    assert (found.file, found.says) == ("logs/a.json", "is a damaged receipt")


def test_a_temporary_file_is_named(results):
    (results / "figures/.f.png.host.7.part").write_bytes(b"half")
    (found,) = faults(results)
    assert (found.file, found.says) == ("figures/.f.png.host.7.part", "is a temporary file of an unfinished job")
