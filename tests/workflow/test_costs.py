"""Work of a run in numbers that no busy machine changes: processes, imports of slow libraries, bytes of the page."""

from collections import Counter

import pytest

from support.projects.workflow_project import Project

#: Module that Python imports at the start of each interpreter, if it is on the path. An interpreter writes its start
#: and its first import of each slow library; a fork of it, which has what was imported, its own.
HOOK = """
import os, sys

place = os.open("counted", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
slow = {"xarray", "matplotlib", "numba", "bokeh", "pandas"}

def note(event, told):
    if event == "import" and told[0] in slow:
        slow.discard(told[0])
        os.write(place, f"{told[0]}\\n".encode())

os.write(place, b"interpreters\\n")
os.register_at_fork(after_in_child=lambda: os.write(place, b"forks\\n"))
sys.addaudithook(note)
"""

#: At most so many in a smoke run from an empty kernel cache, whose 29 jobs make files.
MOST = {
    "interpreters": 2,  # Snakemake, and the process that forks
    "forks": 29,
    "numba": 1,  # the displaced orbits, which numba compiles
    "matplotlib": 1,
    "bokeh": 0,  # the page is written without its classes
    "xarray": 1,
    "pandas": 1,  # xarray
}
#: Bytes of the page of the smoke run.
PAGE = 2_500_000


@pytest.mark.slow
def test_run_starts_and_imports_no_more_than_its_jobs_need(tmp_path, monkeypatch):
    project = Project(tmp_path / "counted")
    (project.folder / "src/sitecustomize.py").write_text(HOOK)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    done = project.python("-m", "snakemake", "-j2", "--configfile", "config/smoke.yaml")
    assert done.returncode == 0, done.stderr
    counted = Counter((project.folder / "counted").read_text().split())
    assert {name: number for name, number in counted.items() if number > MOST[name]} == {}, counted
    assert (project.folder / "results/smoke/report.html").stat().st_size <= PAGE
