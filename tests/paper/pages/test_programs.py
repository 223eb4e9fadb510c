"""Programs, commands and files that pages show: they print, write and check what the pages say."""

import contextlib
import io
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.integrators import tableaus_of
from nearharmonic_paper.record import archive as pack
from nearharmonic_paper.record import verify
from support.results import finished_results
from support.results.stated_numbers import ROOT

HOW_TO = {path.stem: path.read_text(encoding="utf-8") for path in ROOT.glob("docs/how_to/*.md")}
TABLEAUS = ROOT / "tests/library/exchange/tableaus"
ADDED = ROOT / "tests/support/projects/added/source"
TANGENT = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", HOW_TO["tangent_maps"], flags=re.DOTALL)


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", HOW_TO[page], flags=re.DOTALL)


@pytest.fixture
def working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("program", "shown"), TANGENT, ids=[text.split()[0] for _, text in TANGENT])
def test_program_with_deviations_prints_what_the_page_shows(program, shown):
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(program, "tangent_maps.md", "exec"), {})
    words, wanted = printed.getvalue().split(), shown.split()
    if "digits_lost" not in program:
        assert words == wanted
    else:  # another processor may round otherwise, which changes a rounded digit by one
        assert np.abs(np.array(words, int) - np.array(wanted, int)).max() <= 1


@pytest.mark.slow
def test_commands_of_own_integrators_work_one_after_another(working_folder, capsys):
    lines = "".join(blocks("own_integrators", "bash")).splitlines()
    commands = [line.split()[1:] for line in lines if line.startswith("nearharmonic ")]
    assert [words[0] for words in commands] == ["new", "verify-tableau", "recommend"]
    assert [main(words) for words in commands] == [0, 0, 0]
    Path("block.py").write_text(blocks("own_integrators", "python")[0], encoding="utf-8")
    (block,), (template,) = (tableaus_of(name, {}).values() for name in ("block.py", "my_method.py"))
    assert (block.order, block.kick, block.drift) == (template.order, template.kick, template.drift)
    capsys.readouterr()
    (text,) = blocks("own_integrators", "toml")
    Path("wrong.toml").write_text(text, encoding="utf-8")
    assert main(["verify-tableau", "wrong.toml"]) == 1
    (said,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("looks wrong")]
    right, wrong = tomllib.loads(text)["kick"][2], tomllib.loads(text)["kick"][0]
    assert said.startswith(f"looks wrong: kick[0] = {wrong}: with {right}")


@pytest.mark.slow
def test_hook_of_pre_commit_takes_tableaus_and_checks_them(capsys):
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    of_page, _ = map(yaml.safe_load, blocks("exchange", "yaml"))
    assert [one["id"] for one in of_page["repos"][0]["hooks"]] == [hook["id"]]
    assert of_page["repos"][0]["rev"] == f"v{nh.__version__}"
    places = [path.relative_to(ROOT).as_posix() for path in TABLEAUS.glob("*/*")]
    assert all(re.search(hook["files"], place) for place in places)
    assert not re.search(hook["files"], "pyproject.toml")
    chosen = [place for place in places if Path(place).stem in {"na7", "mclachlan_atela_4", "galpy_symplec4"}]
    assert main([*hook["entry"].split()[1:], *(str(ROOT / place) for place in chosen)]) == 0
    assert capsys.readouterr().out.count("all claims hold") == len(chosen) == 3


@pytest.mark.slow
def test_commands_of_deposits_work_on_an_archive(working_folder, monkeypatch):
    result = finished_results.write_result(working_folder / "results/paper")
    monkeypatch.setattr(verify, "faults", lambda folder: [])
    shown = blocks("deposit", "bash")
    commands = [line.split()[1:] for block in shown for line in block.splitlines() if line.startswith("nearharmonic")]
    assert [main(words) for words in commands] == [0] * len(commands)
    Path("paper.zip").unlink()
    pack.save(result, Path("paper.zip"), with_runs=True)
    (unpacked,) = [block for block in shown if "zipfile" in block]
    (wrapped,) = re.findall(r"^python3 -c .*?$", "".join(shown), flags=re.MULTILINE)
    for command in (unpacked, wrapped):
        subprocess.run(command.replace("python3", sys.executable), shell=True, check=True)
    deposit = json.loads(Path("deposit.json").read_text(encoding="utf-8"))["metadata"]
    assert all(f"`{key}`" in HOW_TO["deposit"] for key in deposit)


@pytest.mark.parametrize(("block", "name"), list(enumerate(("experiment.py", "settings.py", "figure.py", "rules.smk"))))
def test_blocks_of_own_experiments_are_files_of_the_example(block, name):
    _, _, shown = (ADDED / name).read_text(encoding="utf-8").partition("\n\n")  # without the docstring
    assert blocks("own_experiments", "text")[block].strip() == shown.strip()
