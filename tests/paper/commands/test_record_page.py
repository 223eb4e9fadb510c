"""docs/how_to/record.md and README's section on it: commands run, columns exist, numbers come again."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from nearharmonic.cli import main

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


def test_lines_of_python_on_page_print_number_beside_them(capsys):
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(block, "record.md", "exec"), {})
    assert capsys.readouterr().out.strip() == re.search(r"# (\S+)", block)[1]
