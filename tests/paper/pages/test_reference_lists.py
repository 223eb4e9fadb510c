"""Lists of docs/reference: signatures, commands, statuses, dimensions and variables are those of the code."""

from __future__ import annotations

import inspect
import re

import pytest

import nearharmonic as nh
from nearharmonic import cli
from support.results.stated_numbers import ROOT

NAMES = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs/reference/command_line.md").read_text(encoding="utf-8")
#: Defaults that are written out.
PLAIN = (str, int, float, tuple, type(None))
DATASETS = {
    "integrate": lambda: nh.integrate("sho", "ruth", 0.3, t_end=3),
    "sweep": lambda: nh.sweep("sho", "ruth", [0.3, 0.2], t_end=3),
    "ensemble": lambda: nh.ensemble("sho", "ruth", 0.3, t_end=3, q0=[[1], [2]]),
    "tangent": lambda: nh.tangent("sho", "ruth", 0.3, t_end=3, q0=[[1], [2]]),
    "gradient": lambda: nh.gradient(
        "kepler", "ruth", 10, "angular_momentum", t_end=30, q0=[[80, 0], [90, 0]], coefficients=True
    ),
    "recommend": lambda: nh.recommend("sho", 1e-2, methods=["ruth"], t_end=10),
}


def signature(name):
    """Arguments of a function with their defaults, "..." for a default that is an object."""
    words, marked = [], False
    for one in inspect.signature(getattr(nh, name)).parameters.values():
        if one.kind is one.KEYWORD_ONLY and not marked:
            marked = True
            if not words or not words[-1].startswith("*"):
                words.append("*")
        default = "" if one.default is one.empty else "=" + (repr(one.default) if type(one.default) in
            {*PLAIN, bool} else "...")  # fmt: skip
        words.append(("*" if one.kind is one.VAR_POSITIONAL else "") + one.name + default)
    return f"{name}({', '.join(words)})"


def callables():
    return {name for name in nh.__all__ if inspect.isfunction(getattr(nh, name)) or isinstance(getattr(nh, name), type)}


def rows(page, head, columns):
    """Cells of the table with this word at the head of its first column."""
    (table,) = re.findall(rf"^\| {head} \|.*\n(?:\|.*\n)+", page, re.MULTILINE)
    return [[cell.strip() for cell in line.strip("|").split("|")][:columns] for line in table.splitlines()[2:]]


def words_in(cell):
    return set(re.findall(r"`([\w.]+)`", cell))


def test_signatures_are_those_of_the_functions():
    (block,) = re.findall(r"```text\n(.*?)```", NAMES, re.DOTALL)
    listed = re.sub(r"\n    \s*", " ", block).splitlines()
    expected = {signature(name) for name in callables() - {"NearharmonicError"}}
    assert set(listed) == expected
    assert len(listed) == len(expected)


def test_names_without_signature_are_listed():
    (sentence,) = re.findall(r"The\s+names of `nearharmonic` itself are (.*?)\.\s", NAMES, re.DOTALL)
    assert words_in(sentence) == set(nh.__all__) - (callables() - {"NearharmonicError"})


def test_commands_are_those_of_the_page():
    (sentence,) = re.findall(r"The commands are (.*?)\. Each", COMMANDS, re.DOTALL)
    assert re.findall(r"`([\w-]+)`", sentence) == list(cli.command_names())


@pytest.mark.slow
def test_exit_statuses_are_those_of_the_page(capsys):
    damaged = ROOT / "tests/library/exchange/tableaus/damaged/claim.toml"
    found = [cli.main(words) for words in (["list"], ["verify-tableau", str(damaged)], ["lists"])]
    assert [int(status) for status, _ in rows(COMMANDS, "exit status", 2)] == [*found, cli.INTERRUPTED]
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("name", DATASETS)
def test_datasets_have_dimensions_and_variables_of_page(name):
    table = {next(iter(words_in(function))): cells for function, *cells in rows(NAMES, "function", 3)}
    assert set(table) == {f"nh.{one}" for one in DATASETS}
    dimensions, variables = (words_in(cell) for cell in table[f"nh.{name}"])
    if variables == {"nh.integrate"}:
        variables = words_in(table["nh.integrate"][1])
    found = DATASETS[name]()
    assert {name for name in found.sizes if not str(name).endswith("_component")} == dimensions
    assert variables <= set(found.variables)


def test_environment_variables_of_page_are_read_somewhere():
    named = set(re.findall(r"NEARHARMONIC_\w+", COMMANDS))
    assert len(named) > 1
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    assert {name for name in named if f'"{name}"' not in sources} == set()
