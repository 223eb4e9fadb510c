"""README's Python blocks run as printed, and its commands are those that CI runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import xarray as xr

from nearharmonic.integrate import integrate_run
from nearharmonic.plan import Run, steps_of
from nearharmonic.reduce import cube
from nearharmonic.store import write_dataset

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


@pytest.fixture
def beside_results(tmp_path, monkeypatch):
    """A folder with a small cube where README expects the paper's."""
    runs = {}
    for name, stages in (("ruth", 3), ("babps8o7h", 8)):
        steps = tuple(steps_of("50", tau * stages) for tau in (0.05, 0.1, 0.2))
        run = Run(
            system="henon_heiles", integrator=name, precision="double", summation="compensated", first=None,
            t_end="50", tau_per_stage=(0.05, 0.1, 0.2), steps=steps, samples=10,
        )  # fmt: skip
        runs[name] = {"double": [xr.Dataset(integrate_run(run))]}
    write_dataset(tmp_path / "results/paper/cubes/henon_heiles.h5", cube("henon_heiles", runs), {})
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_a_python_block_runs_as_printed(beside_results, block):
    names = {}
    if "nh." in block and "import nearharmonic" not in block:
        exec("import nearharmonic as nh", names)
    exec(compile(block, "README.md", "exec"), names)


def test_the_cube_snippet_ranks_the_methods(beside_results, capsys):
    (block,) = [block for block in BLOCKS if "open_dataset" in block]
    exec(compile(block, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert printed.index("babps8o7h") < printed.index("ruth")


def test_ci_runs_readmes_test_command():
    (command,) = re.findall(r"```bash\n(python3 .*pytest)\n```", README)
    assert command in (ROOT / ".ci/run").read_text(encoding="utf-8")


def test_readme_links_lead_somewhere():
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
