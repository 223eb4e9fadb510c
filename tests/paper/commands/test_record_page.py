"""docs/how_to/record.md and README's section on it: commands run, columns exist, numbers come again."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic_paper.record.query.run_table import COLUMNS, run_table

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/record.md").read_text(encoding="utf-8")
SECTION = re.split(r"^## ", (ROOT / "README.md").read_text(encoding="utf-8").partition("## Ask the results")[2])[0]
COMMANDS = {
    *re.findall(r"^(?:\.venv/bin/)?nearharmonic ((?:history|runs|show|compare)\b.*)$", PAGE + SECTION, re.MULTILINE)
}


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_a_command_of_the_page_runs(project, command, capsys):
    shutil.copytree(project, project.with_name("smoke"))
    # The small result has fewer step sizes than the default config's.
    words = [{"36": "150", "0.001": "0.002", "0.01": "0.018"}.get(word, word) for word in shlex.split(command)]
    assert main(words) == 0
    assert capsys.readouterr().out


@pytest.mark.slow
def test_the_page_names_every_column(project):
    table = re.search(r"\| column \| meaning \|\n(.*?)\n\n", PAGE, re.DOTALL)[1]
    named = [name for line in table.splitlines() for name in re.findall(r"`(\w+)`", line.split(" | ")[0])]
    assert named == ["result", *named[1:]]
    assert set(named[1:]) == {*COLUMNS, *run_table({"paper": project})[0]}


def test_the_rows_on_the_page_are_runs_with_these_numbers():
    rows = re.findall(r"^(\w+) +([\d.]+) +(\d+) +([\d.]+e-\d+)$", PAGE, re.MULTILINE)
    assert len(rows) == 3
    for name, tau, evaluations, error in rows:
        run = nh.integrate("kepler", name, float(tau), samples=2)
        assert int(evaluations) == run.evaluations.item()
        # Six digits of the error are printed; the step has so many that the number of steps is that of the run.
        assert float(error) == pytest.approx(run.max_energy_error.item(), rel=1e-5)


def test_lines_of_python_on_page_print_number_beside_them(capsys):
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(block, "record.md", "exec"), {})
    assert capsys.readouterr().out.strip() == re.search(r"# (\S+)", block)[1]
