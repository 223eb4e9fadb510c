"""The page on deposits names what an archive holds, the keys of its metadata, and commands that there are."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from nearharmonic.cli import main
from nearharmonic_paper.record import verify
from nearharmonic_paper.record.archive import pack
from support.results import finished_results

PAGE = (Path(__file__).parents[3] / "docs/how_to/deposit.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```bash\n(.*?)```", PAGE, flags=re.DOTALL)


def first_column(head):
    """Texts in quotes in the first column of the table with this head."""
    (table,) = re.findall(rf"^\| {head} \|.*?\n\n", PAGE, flags=re.DOTALL | re.MULTILINE)
    return [name for row in table.strip().splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


@pytest.fixture
def beside_archive(tmp_path, monkeypatch):
    """A working directory with an archive ``paper.zip``."""
    result = finished_results.write_result(tmp_path / "results/paper")
    pack.save(result, tmp_path / "paper.zip", with_runs=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_page_names_everything_in_an_archive(beside_archive):
    with ZipFile("paper.zip") as zipped:
        held = {name.partition("/")[0] + "/" * ("/" in name) for name in zipped.namelist()}
    held = {re.sub(r"config-\w{12}", "config-<digest>", name) for name in held}
    named = set(first_column("in the archive"))
    assert held <= named
    assert named - held == {"user_files/", "figure-1.html"}  # the small result has neither


def test_page_names_the_keys_of_the_metadata_with_their_values(beside_archive):
    with ZipFile("paper.zip") as zipped:
        deposit = json.loads(zipped.read(".zenodo.json"))
    assert sorted(first_column("key")) == sorted(deposit)
    assert f"`{deposit['upload_type']}`, `{deposit['access_right']}`, `{deposit['language']}`" in PAGE
    for one in deposit["related_identifiers"]:
        assert f"`{one['relation']}`" in PAGE


def test_commands_of_the_page_work_on_a_result(beside_archive, monkeypatch):
    Path("paper.zip").unlink()
    monkeypatch.setattr(verify, "faults", lambda folder: [])
    commands = [line.split()[1:] for block in BLOCKS for line in block.splitlines() if line.startswith("nearharmonic")]
    assert len(commands) == 4
    assert [main(words) for words in commands] == [0] * 4


def test_lines_of_python_in_the_shell_make_the_document(beside_archive):
    (unpacked,) = [block for block in BLOCKS if "zipfile" in block]
    (wrapped,) = re.findall(r"^python3 -c .*?$", "".join(BLOCKS), flags=re.MULTILINE)
    for command in (unpacked, wrapped):
        subprocess.run(command.replace("python3", sys.executable), shell=True, check=True)
    document = json.loads(Path("deposit.json").read_text(encoding="utf-8"))
    with ZipFile("paper.zip") as zipped:
        assert document == {"metadata": json.loads(zipped.read(".zenodo.json"))}
