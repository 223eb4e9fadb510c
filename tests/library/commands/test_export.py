"""``nearharmonic export``: texts for other programs, and errors for unsupported input."""

from __future__ import annotations

import json

import pytest

from nearharmonic.cli import main
from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.files import export
from nearharmonic.integrators import integrators

OWN = """
from nearharmonic import Tableau, palindrome

TABLEAUS = tuple(
    Tableau(name=name, order=2, first="drift", drift=palindrome("2e-1", "+.3"), kick=palindrome("0.35", centre="0.3"),
            source="made up", digits=20)
    for name in ("mine", "other")
)
"""


@pytest.mark.parametrize("to", TARGETS)
def test_the_text_alone_is_printed(to, capsys):
    assert main(["export", "ruth", "--to", to, "--digits", "20"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == (export(integrators["ruth"], to, 20), "")


def test_json_of_the_answer_holds_the_text(capsys):
    assert main(["export", "ruth", "--to", "c", "--format", "json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found == {"integrator": "ruth", "to": "c", "text": export(integrators["ruth"], "c")}


def test_an_integrator_of_a_file_is_exported_by_its_path(tmp_path, capsys):
    (tmp_path / "methods.py").write_text(OWN, encoding="utf-8")
    assert main(["export", f"{tmp_path}/methods.py:other", "--to", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["drift"] == ["0.2", "0.3", "0.3", "0.2"]
    assert main(["export", f"{tmp_path}/methods.py", "--to", "json"]) == 2
    assert "defines 2 integrators: name one, as in" in capsys.readouterr().err
