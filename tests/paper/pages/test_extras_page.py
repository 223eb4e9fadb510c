"""docs/developers/extras.md: extras of pyproject.toml, their sizes, and README's Python without any of them."""

from __future__ import annotations

import platform
import re
import subprocess
import sys

import pytest

from support.projects.extras import EXTRAS
from support.projects.installed import closure, mebibytes_in, mebibytes_of
from support.results.stated_numbers import ROOT

PAGE = (ROOT / "docs/developers/extras.md").read_text(encoding="utf-8")
ROWS = {name: size for name, size in re.findall(r"^\| (\S+) \|.*\|(.*)\|$", PAGE, re.MULTILINE) if name != "extra"}
#: Sizes in MB by extra; "" is the library alone.
SIZES = {name.strip("`").replace("(none)", ""): float(size) for name, size in ROWS.items() if size.strip()}
#: Relative difference between a machine and the page: versions of Python, and what pip compiles.
SAME = 0.1
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "results/paper" not in block]

measured_on_linux = pytest.mark.skipif(
    (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="the sizes are those of Linux x86-64"
)


def test_page_lists_every_extra():
    assert {name.strip("`") for name in ROWS if name.startswith("`")} == set(EXTRAS)
    assert set(SIZES) == {"", "figures", "tailor", "workflow", "test"}


@pytest.mark.slow
@measured_on_linux
@pytest.mark.parametrize("extra", SIZES)
def test_size_of_extra_is_that_of_page(extra):
    """Files of what the requirements install, and pip."""
    found = mebibytes_of(closure(f"nearharmonic[{extra}]" if extra else "nearharmonic") | {"pip"})
    assert found == pytest.approx(SIZES[extra], rel=SAME)


@pytest.mark.long
def test_bare_environment_runs_readme_and_has_its_size(tmp_path):
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "bare")], check=True)
    python = tmp_path / "bare/bin/python"
    words = [python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", ROOT]
    subprocess.run([*map(str, words)], check=True)
    lines = [line for block in BLOCKS for line in block.splitlines() if "nh.plot(" not in line]
    assert len(lines) < len("".join(BLOCKS).splitlines())  # nh.plot was there
    code = "\n".join([*lines, "try: nh.plot(curves)", "except ImportError as error: print(error)"])
    done = subprocess.run([str(python), "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (sentence,) = re.findall(r"```text\n(.*)\n```", PAGE)
    assert done.stdout.splitlines()[-1] == sentence
    if platform.system() == "Linux":
        assert mebibytes_in(tmp_path / "bare/lib") == pytest.approx(SIZES[""], rel=SAME)
