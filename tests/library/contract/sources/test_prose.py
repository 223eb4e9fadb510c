"""Docstrings begin with the noun that a thing is or the verb that it does; words are plain and names short."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[4]
FOLDERS = ("src", "benchmarks", "examples", "tests", "workflow")
#: First words that put off what a thing is.
FORBIDDEN = ("What", "Whether", "How", "Where", "Which", "Of", "The same")
#: Expressions with a plainer word; .codespell/house.txt holds those of one word.
EXPRESSIONS = {"whole number": "integer"}
DEFINITIONS = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
#: Words of the name of a test.
LONGEST_NAME = 10

in_each_folder = pytest.mark.parametrize("folder", FOLDERS)


@cache
def definitions(folder):
    """(path, definition) of every definition in the Python files of a folder."""
    trees = [(path, ast.parse(path.read_text(encoding="utf-8"))) for path in sorted((PROJECT / folder).rglob("*.py"))]
    return [(path, node) for path, tree in trees for node in ast.walk(tree) if isinstance(node, DEFINITIONS)]


def begins_badly(docstring):
    return any(docstring.startswith(f"{words} ") for words in FORBIDDEN)


@pytest.mark.slow
@in_each_folder
def test_docstrings_begin_with_a_noun_or_a_verb(folder):
    found = {(str(path), ast.get_docstring(node) or "") for path, node in definitions(folder)}
    assert len(found) > 1
    assert [(path, text) for path, text in found if begins_badly(text)] == []


def test_descriptions_of_rules_begin_with_a_noun_or_a_verb():
    texts = [path.read_text(encoding="utf-8") for path in (PROJECT / "workflow").rglob("*.smk")]
    found = [words for text in texts for words in re.findall(r'"""(.*?)"""', text, flags=re.DOTALL)]
    assert found
    assert [text for text in found if begins_badly(text)] == []


@pytest.mark.parametrize("folder", [*FOLDERS, "docs", "config", "."])
def test_expressions_are_plain(folder):
    files = (PROJECT / folder).glob("*" if folder == "." else "**/*")
    for path in files:
        if path.suffix in {".py", ".md", ".smk", ".yaml"} and path != Path(__file__):
            text = " ".join(path.read_text(encoding="utf-8").split()).lower()
            assert [words for words in EXPRESSIONS if words in text] == [], path


@pytest.mark.slow
def test_names_of_tests_have_at_most_ten_words():
    named = [
        (str(path), node.name) for path, node in definitions("tests") if getattr(node, "name", "").startswith("test_")
    ]
    assert len(named) > 1
    assert [(path, name) for path, name in named if len(name.split("_")) - 1 > LONGEST_NAME] == []
