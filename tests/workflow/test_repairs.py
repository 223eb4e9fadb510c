"""Equal results have equal files, and damage of any kind is repaired by one plain start."""

import shutil

import pytest

from support.projects.killed_runs import clear, files_in
from support.projects.workflow_project import TINY

COMMAND = ("-j2", "--quiet", "rules", *TINY)


def flip(place):
    content = bytearray(place.read_bytes())
    content[len(content) // 2] ^= 4
    place.write_bytes(content)


@pytest.mark.long
def test_two_runs_make_equal_files_with_page_and_manifest(finished, breakable):
    expected = files_in(finished.results)
    clear(breakable)
    assert breakable.snakemake(*COMMAND).returncode == 0
    found = files_in(breakable.results)
    assert {"report.html", "manifest.json"} <= found.keys() == expected.keys()
    assert [name for name in expected if found[name] != expected[name]] == []


@pytest.mark.slow
def test_damage_of_each_kind_is_repaired_in_one_go(breakable):
    results = breakable.results
    expected = files_in(results)
    flip(results / "runs/sho/ruth/0.h5")
    (results / "runs/kepler/ruth/1.h5").unlink()
    (results / "cubes/henon_heiles.h5").write_bytes(b"")
    shutil.copy(results / "cubes/kepler.h5", results / "cubes/sho.h5")
    flip(results / "figures/fig2_decomposition.pdf")
    (results / "figures/fig6_substeps.png").unlink()
    with (results / "tables/integrators.csv").open("a") as table:
        table.write("more\n")
    (results / "tables/claims.json").write_text("[]")
    (results / "report.html").write_text("")
    flip(results / "logs/reduce/kepler.json")
    (results / "manifest.json").unlink()
    done = breakable.snakemake(*COMMAND)
    assert done.returncode == 0, done.stdout
    found = files_in(results)
    assert [name for name in expected if found.get(name) != expected[name]] == []
    assert breakable.nearharmonic("verify", "tiny").returncode == 0
    assert "Nothing to be done" in breakable.snakemake(*COMMAND).stdout
