"""Pages for developers: named tests and commands exist, the drawing has the layers, marks are those of pytest."""

from __future__ import annotations

import ast
import re
import tomllib

import pytest

from support.results.stated_numbers import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FOLDER = ROOT / "docs/developers"
PAGES = [*sorted(FOLDER.glob("*.md")), ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md"]
CI = (ROOT / ".ci/run").read_text(encoding="utf-8")
#: Most words of SECURITY.md and of the longest pages.
SHORT, LONG = 120, 1200


def text_of(name):
    return (FOLDER / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_that_a_page_names_exist(page):
    for file, name in re.findall(r"\b(tests/[\w/]+\.py)(?:::(\w+))?", page.read_text(encoding="utf-8")):
        assert (ROOT / file).is_file(), file
        if name:
            tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
            assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_is_short(page):
    assert len(page.read_text(encoding="utf-8").split()) <= (SHORT if page.name == "SECURITY.md" else LONG)


def test_page_of_tests_lists_every_mark():
    marks = {mark.partition(":")[0] for mark in PROJECT["tool"]["pytest"]["ini_options"]["markers"]}
    assert set(re.findall(r"^\| `(\w+)` \|", text_of("testing.md"), re.MULTILINE)) == marks


def test_page_of_tests_says_what_default_run_leaves_out():
    options = PROJECT["tool"]["pytest"]["ini_options"]["addopts"]
    left_out = re.findall(r"not (\w+)", options[options.index("-m") + 1])
    assert f"leaves out `{left_out[0]}`, `{left_out[1]}` and `{left_out[2]}`" in text_of("testing.md")


def test_page_of_tests_has_steps_of_ci_in_order():
    """Words of each step, as the script has them."""
    steps = (
        "bin/pytest ||",
        "sphinx-build",
        "tests/library/adapters",
        "slow and not long",
        "smoke.yaml",
        "NPY_DISABLE",
        "ruff check",
    )
    places = [CI.index(words) for words in steps]
    assert places == sorted(places)
    listed = re.findall(r"^(\d)\. ", text_of("testing.md").partition("## `.ci/run`")[2], re.MULTILINE)
    assert listed == [str(i + 1) for i in range(len(steps))]
    (tools,) = re.findall(r"^7\. (.*)$", text_of("testing.md"), re.MULTILINE)
    assert [CI.index(f".venv/bin/{tool}") for tool in re.findall(r"`([\w -]+)`", tools)]


def test_commands_of_contributing_are_those_of_ci():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```bash\n(.*?)```", text.partition("## Checks")[2], re.DOTALL)
    commands = [line.partition("#")[0].strip() for line in block.splitlines()]
    assert len(commands) > 3
    assert [
        command for command in commands if f"{command}\n" not in CI.replace(" || exit 1", "").replace(" &\n", "\n")
    ] == []


def test_drawing_has_the_layers_of_the_import_contracts():
    drawn = re.findall(r'<tspan class="room">(\w+)<', text_of("layers.svg"))
    library, reproduction = (one["layers"] for one in PROJECT["tool"]["importlinter"]["contracts"][:2])
    assert drawn == [room.strip() for layer in (*library, *reproduction) for room in layer.split("|")]
    heights = [float(y) for y in re.findall(r'<rect x="[\d.]+" y="([\d.]+)".*fill="#dbeafe"', text_of("layers.svg"))]
    places = [i for i, layer in enumerate(library) for _ in layer.split("|")]
    assert [heights.index(height) for height in heights] == [places.index(place) for place in places]


def test_kernels_take_the_time_of_c_within_an_eighth():
    assert "the same time within an eighth" in " ".join(text_of("decisions.md").split())
    page = (ROOT / "docs/results/timings.md").read_text(encoding="utf-8")
    table = page.partition("| run | C as written | C looking ahead | ours |")[2].partition("\n\n")[0]
    times = [[float(cell) for cell in line.strip("|").split("|")[1:]] for line in table.splitlines()[2:]]
    assert len(times) > 5
    assert max(abs(ours / ahead - 1) for _, ahead, ours in times) < 1 / 8
