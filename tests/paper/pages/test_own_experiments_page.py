"""The page on experiments of one's own shows the files of the experiment that test_extensions.py adds and makes."""

from __future__ import annotations

import re
from dataclasses import fields

import pytest

from nearharmonic_paper.tasks.experiment import Experiment
from support.projects.workflow_project import ROOT

PAGE = (ROOT / "docs/how_to/own_experiments.md").read_text(encoding="utf-8")
ADDED = ROOT / "tests/support/projects/added"
BLOCKS = re.findall(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)

SHOWN = ("experiment.py", "settings.py", "figure.py", "rules.smk")


def first_column(head):
    (table,) = re.findall(rf"^\| {head} \|.*?\n\n", PAGE, flags=re.DOTALL | re.MULTILINE)
    return [name for row in table.strip().splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


@pytest.mark.parametrize(("block", "name"), list(enumerate(SHOWN)))
def test_blocks_of_the_page_are_files_of_the_example(block, name):
    _, _, shown = (ADDED / "source" / name).read_text(encoding="utf-8").partition("\n\n")  # without the docstring
    assert BLOCKS[block].strip() == shown.strip()


def test_page_names_the_files_of_the_folder():
    assert sorted(first_column("file")) == sorted(path.name for path in (ADDED / "source").iterdir() if path.is_file())


def test_page_names_the_arguments_of_a_declaration():
    assert sorted(first_column("argument")) == sorted(field.name for field in fields(Experiment))


def test_line_of_the_snakefile_is_that_of_the_test():
    text = (ROOT / "tests/workflow/test_extensions.py").read_text(encoding="utf-8")
    room = re.search(r'room = "(.*?)"', text)[1]
    assert BLOCKS[4].strip() == f'include: "{room}/rules.smk"'
    assert 'include: "workflow/rules/two_steps.smk"' in text
    assert f"`{room}/`" in PAGE


def test_tests_that_the_page_names_are_those_of_the_example():
    tests = {path.name for path in (ADDED / "tests").iterdir()}
    assert {name for name in tests if f"`{name}`" in PAGE} == {"example_cubes.py", "tiny.yaml"}
    for path in re.search(r"^pytest (.*)$", PAGE, flags=re.MULTILINE)[1].split()[:2]:
        assert (ROOT / path).is_file()
