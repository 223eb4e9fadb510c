"""The page on exporting shows what the command writes."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import yaml

import nearharmonic as nh
from nearharmonic.cli import command_names, main
from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.export import export
from nearharmonic.integrators import integrators

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/exchange.md").read_text(encoding="utf-8")
#: Configuration of pre-commit, and a workflow of GitHub.
HOOKS, WORKFLOW = map(yaml.safe_load, re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL))
(HOOK,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
TABLEAUS = ROOT / "tests/library/exchange/tableaus"


def test_the_page_shows_the_json_of_the_leapfrog():
    (block,) = re.findall(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)
    assert block == export(integrators["leapfrog"], "json")


def test_the_page_says_what_each_target_writes():
    (table,) = re.findall(r"^\| `--to` \|.*?\n\n", PAGE, flags=re.DOTALL | re.MULTILINE)
    named = {name for row in table.strip().splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])}
    assert named == set(TARGETS)


def test_hook_of_page_is_that_of_repository():
    (repository,) = HOOKS["repos"]
    assert [hook["id"] for hook in repository["hooks"]] == [HOOK["id"]]
    assert repository["rev"] == f"v{nh.__version__}"
    program, command = shlex.split(HOOK["entry"])
    assert program == "nearharmonic"
    assert command in command_names()


def test_hook_checks_all_files_that_it_takes(capsys):
    taken = [
        str(path.relative_to(ROOT))
        for path in sorted(TABLEAUS.glob("*/*"))
        if re.search(HOOK["files"], path.relative_to(ROOT).as_posix())
    ]
    assert len(taken) == len([*TABLEAUS.glob("*/*")])
    assert not re.search(HOOK["files"], "pyproject.toml")
    assert not re.search(HOOK["files"], "tableaus/README.md")
    chosen = [str(ROOT / one) for one in taken if Path(one).stem in {"na7", "mclachlan_atela_4", "galpy_symplec4"}]
    assert len(chosen) == 3  # .json, .csv and .toml
    assert main([*shlex.split(HOOK["entry"])[1:], *chosen]) == 0
    assert capsys.readouterr().out.count("all claims hold") == 3


def test_workflow_of_page_runs_the_command():
    *_, install, verify = WORKFLOW["jobs"]["verify"]["steps"]
    (repository,) = HOOKS["repos"]
    assert install["run"] == f"pip install git+{repository['repo']}"
    program, command, file = shlex.split(verify["run"])
    assert (program, command in command_names()) == ("nearharmonic", True)
    assert re.search(HOOK["files"], file)
