"""Verification: every flipped bit, every missing and extra file, other code and other coefficients."""

from __future__ import annotations

import json
import random

import pytest

from nearharmonic.output.provenance import task
from nearharmonic.output.receipts import Receipt
from nearharmonic.record import manifest, verify
from nearharmonic.record.verify import faults

TASK = task("experiments.paper.run:integrate", system="sho", integrator="ruth")
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
    (folder / "history.jsonl").write_text("{}\n")
    verify._difference.cache_clear()
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
        assert (found.file, found.says) == (name, "is damaged: its bytes are not those that its job wrote")
        assert found.mend.startswith("Make it again: snakemake -j2 --configfile config/smoke.yaml --force ")
        assert found.mend.endswith(name)


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
    place.write_text(manifest.sealed(document))
    verify._difference.cache_clear()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"code": "0" * 64}, "was made with other code (and 4 more), by experiments.paper.run:integrate"),
        ({"coefficients": "0" * 64}, "was made with other coefficients (and 4 more), by"),
        ({"code": "0", "coefficients": "0"}, "was made with other code and coefficients (and 4 more), by"),
        ({"integrators": ["leapfrog"]}, "was made with other coefficients (and 4 more), by"),
        ({"systems": ["kepler"]}, "was made with other code (and 4 more), by"),
        (
            {"systems": ["no_more"]},
            "was made with other code, of which something is not here (unknown system 'no_more'",
        ),
        ({"function": "gone.run:measure"}, "was made with other code, of which something is not here (no module"),
    ],
)
def test_other_code_and_other_coefficients_are_told_once_for_each_function(results, changes, says):
    edit(results, **changes)
    (found,) = faults(results)
    assert found.says.startswith(says)
    assert found.mend == "Make what is out of date again: snakemake -j2 --configfile config/smoke.yaml"


def test_a_fault_reads_as_a_sentence(results):
    (results / "cubes/sho.h5").unlink()
    assert str(faults(results)[0]) == (
        "cubes/sho.h5 is missing. Make it again: snakemake -j2 --configfile config/smoke.yaml --force "
        f"{results / 'cubes/sho.h5'}"
    )


def test_files_and_bytes_are_counted(results):
    assert verify.extent(results) == (len(FILES), sum(map(len, FILES.values())))
