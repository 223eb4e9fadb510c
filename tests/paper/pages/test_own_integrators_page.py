"""The page on integrators of one's own: its commands, the file of its steps, and a file in the registry."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.integrators.file import tableaus_of

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/own_integrators.md").read_text(encoding="utf-8")
BASH = "".join(re.findall(r"```bash\n(.*?)```", PAGE, flags=re.DOTALL))
COMMANDS = [line.split()[1:] for line in BASH.splitlines() if line.startswith("nearharmonic ")]
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.fixture(autouse=True)
def _working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_commands_of_the_page_work_one_after_another(capsys):
    assert [words[0] for words in COMMANDS] == ["new", "verify-tableau", "recommend"]
    assert [main(words) for words in COMMANDS] == [0, 0, 0]
    assert "my_method.py" in capsys.readouterr().out


def test_block_of_the_page_is_the_method_of_the_template():
    assert main(COMMANDS[0]) == 0
    Path("block.py").write_text(PYTHON[0], encoding="utf-8")
    (block,), (template,) = (tableaus_of(name, {}).values() for name in ("block.py", "my_method.py"))
    for name in ("order", "first", "kick", "drift", "digits", "source"):
        assert getattr(block, name) == getattr(template, name)
    assert nh.integrators["my_method.py"].order == 2


def test_wrong_digit_of_the_page_is_named(capsys):
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    Path("my_method.toml").write_text(text, encoding="utf-8")
    assert main(["verify-tableau", "my_method.toml"]) == 1
    (said,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("looks wrong")]
    right, wrong = tomllib.loads(text)["kick"][2], tomllib.loads(text)["kick"][0]
    assert said.startswith(f"looks wrong: kick[0] = {wrong}: with {right}")
    differing = [place for place, (a, b) in enumerate(zip(right, wrong, strict=True)) if a != b]
    assert differing == [len("0.") + 5]  # the sixth decimal


@pytest.mark.parametrize(
    ("old", "new", "status"),
    [
        ("7836", "7846", 2),
        ("order=2", "order=3", 2),
        ("# harmonic_order=2", "harmonic_order=4", 1),
        ('palindrome("0.5")', '("0.4", "0.6")', 2),
    ],
)
def test_status_tells_an_error_from_a_claim_that_fails(old, new, status):
    assert main(COMMANDS[0]) == 0
    place = Path("my_method.py")
    assert old in place.read_text()
    place.write_text(place.read_text().replace(old, new))
    assert main(COMMANDS[1]) == status


@pytest.mark.slow
def test_observed_order_of_the_block_is_the_proved_one(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    exec(compile(PYTHON[1], "own_integrators.md", "exec"), {})
    observed, proved = capsys.readouterr().out.split()
    # The next term is smaller by tau^2 and its constant; the page measures at 0.04 and 0.02 per stage.
    assert float(observed) == pytest.approx(int(proved), abs=0.1)


@pytest.mark.slow
def test_file_in_the_folder_of_integrators_is_registered(tmp_path):
    (text,) = re.findall(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)
    package = shutil.copytree(
        ROOT / "src/nearharmonic", tmp_path / "src/nearharmonic", ignore=lambda *_: ["__pycache__"]
    )
    (package / "integrators/omelyan_mryglod_folk_2002.py").write_text(text, encoding="utf-8")
    code = "import nearharmonic as nh; print(len(nh.integrators), nh.integrators['two_kicks'].order)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(tmp_path / "src")},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout.split() == [str(len(nh.integrators) + 1), "2"]


def test_commands_for_a_registered_method_name_what_exists():
    (paths,) = re.findall(r"^pytest (.*)$", BASH, flags=re.MULTILINE)
    assert all((ROOT / path).exists() for path in paths.split())
    (rule,) = re.findall(r"^snakemake -j1 page_of_(\w+)$", BASH, flags=re.MULTILINE)
    assert f'"reference/{rule}": (' in (ROOT / "workflow/rules/pages.smk").read_text(encoding="utf-8")
