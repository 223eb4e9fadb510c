"""Docstrings begin with the noun that a thing is, or with the verb that says what it does."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[3]
SOURCES = sorted(path for folder in ("src", "benchmarks") for path in (PROJECT / folder).rglob("*.py"))
#: First words that put off what a thing is.
FORBIDDEN = {"What", "Whether", "How", "Where", "Which", "Of"}
DEFINITIONS = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PROJECT)))
def test_docstrings_begin_with_a_noun_or_a_verb(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, DEFINITIONS)]
    assert [text for text in found if text.split(" ", 1)[0] in FORBIDDEN] == []
