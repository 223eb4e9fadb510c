"""Exported texts, of every registered integrator: numbers, rows and roles, read back without a compiler."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import fields, replace
from decimal import Decimal
from fractions import Fraction

import pytest

from nearharmonic import Tableau, integrators
from nearharmonic.errors import SettingError
from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.files import export
from nearharmonic.exchange.method import comment, identifier
from support.methods.ten_methods import EVERY_METHOD
from support.oracles.word_series import operators_of
from support.projects.exported_programs import array

PROGRAMS = ("c", "julia", "rebound", "diffrax", "sundials", "fortran")
READERS = {"json": json.loads, "toml": tomllib.loads}


def arrays(tableau, to, text):
    """The rows of kicks and of drifts as a program has them."""
    name = identifier(tableau)
    names = {
        "fortran": ("c_kick", "c_drift"),
        "sundials": ("ahat", "a"),
        "rebound": ("KICK", "DRIFT"),
        "diffrax": ("KICK", "DRIFT"),
    }.get(to, (f"{name}_kick", f"{name}_drift"))
    return tuple(array(text, one) for one in names)


@EVERY_METHOD
@pytest.mark.parametrize("to", ["json", "toml"])
def test_an_exported_table_reads_back_digit_for_digit(name, to):
    tableau = integrators[name]
    read = READERS[to](export(tableau, to))
    rows = {key: tuple(read.pop(key)) for key in ("kick", "drift")}
    again = Tableau(**rows, **read)
    unsaid = {"note", "benchmarked", "generalised_order"}
    assert all(getattr(again, f.name) == getattr(tableau, f.name) for f in fields(Tableau) if f.name not in unsaid)
    assert again.digest() == tableau.digest()


def test_json_says_null_and_toml_nothing_where_there_is_nothing():
    assert json.loads(export(integrators["ruth"], "json"))["harmonic_order"] is None
    assert "harmonic_order" not in tomllib.loads(export(integrators["ruth"], "toml"))


@EVERY_METHOD
@pytest.mark.parametrize("digits", [1, 16, 33])
def test_rounded_coefficient_error_is_at_most_half_last_unit(name, digits):
    tableau = integrators[name]
    digits = min(digits, tableau.digits)
    read = json.loads(export(tableau, "json", digits))
    assert read["digits"] == digits
    for text, exact in zip(read["kick"] + read["drift"], tableau.kick + tableau.drift, strict=True):
        unit = Fraction(10) ** (Decimal(exact).adjusted() - digits + 1)
        assert abs(Fraction(text) - Fraction(exact)) <= unit / 2
        assert (Fraction(text) / unit).denominator == 1


@EVERY_METHOD
@pytest.mark.parametrize("to", PROGRAMS)
def test_program_has_by_default_doubles_that_our_kernels_have(name, to):
    tableau = integrators[name]
    kick, drift = arrays(tableau, to, export(tableau, to))
    if to == "sundials":  # a zero stands where a stage of ARKODE has no kick or no drift
        if tableau.symmetric:
            kick, drift = (kick, drift[:-1]) if tableau.first == "kick" else (kick[1:], drift)
        else:
            kick = [*kick, "0"]
    assert [float(text) for text in kick] == [float(Fraction(text)) for text in tableau.kick]
    assert [float(text) for text in drift] == [float(Fraction(text)) for text in tableau.drift]


@pytest.mark.parametrize("to", PROGRAMS)
@pytest.mark.parametrize("digits", [5, 17, 30])
def test_a_program_has_the_digits_that_are_asked_for(to, digits):
    tableau = integrators["babps8o7h"]
    data = json.loads(export(tableau, "json", digits))
    kick, drift = arrays(tableau, to, export(tableau, to, digits))
    assert kick == data["kick"]
    assert drift[: len(data["drift"])] == data["drift"]


@EVERY_METHOD
def test_stages_of_sundials_apply_substeps_of_step_in_their_order(name):
    tableau = integrators[name]
    kicks, drifts = arrays(tableau, "sundials", export(tableau, "sundials"))
    applied = [one for a, b in zip(kicks, drifts, strict=True) for one in (("B", float(a)), ("A", float(b)))]
    assert [one for one in applied if one[1]] == [one for one in operators_of(tableau, float) if one[1]]
    assert len(kicks) == tableau.stages + tableau.symmetric  # as many kicks as drifts need no more stages


@EVERY_METHOD
@pytest.mark.parametrize("to", PROGRAMS)
def test_the_head_says_name_orders_roles_and_source(name, to):
    tableau = integrators[name]
    text = export(tableau, to)
    mark = {"c": "//", "sundials": "//", "fortran": "!"}.get(to, "#")
    lines = text.split("\n\n")[0].split("\n")
    assert all(line.startswith(f"{mark} ") for line in lines)
    head = " ".join(line.removeprefix(mark).strip() for line in lines)
    assert f"{tableau.label}: symplectic integrator" in head
    assert f"Name: {name}. Order: {tableau.order}." in head
    assert (f"Harmonic order: {tableau.harmonic_order}." in head) == (tableau.harmonic_order is not None)
    assert f"First: {tableau.first}. A step of length tau is {tableau.first}[0], " in head
    assert ("Requires: a quadratic kinetic energy" in head) == (tableau.requires is not None)
    assert f"Source: {' '.join(tableau.source.split())}" in head


@EVERY_METHOD
@pytest.mark.parametrize("to", ["rebound", "diffrax", "sundials"])
def test_head_says_if_step_takes_more_force_evaluations_than_stages(name, to):
    tableau = integrators[name]
    (comments,) = re.findall(r"\A((?:(?:#|//) .*\n)+)", export(tableau, to))
    said = re.findall(r" (\d+) times", " ".join(comments.replace("//", "").replace("#", "").split()))
    more = tableau.symmetric if to == "sundials" else tableau.first == "kick"
    assert said == ([str(tableau.stages + 1)] if more else [])


@pytest.mark.parametrize("to", TARGETS)
@pytest.mark.parametrize("digits", [0, 77])
def test_digits_that_nobody_knows_are_refused(to, digits):
    with pytest.raises(SettingError, match=f"digits = {digits} is not allowed: an integer from 1 to 76"):
        export(integrators["babps8o7h"], to, digits)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("ruth", "ruth"), ("My method, v2", "my_method_v2"), ("8th", "method_8th"), ("é", "method"), ("x" * 99, "x" * 40)],
)
def test_a_name_becomes_an_identifier_of_every_language(name, expected):
    assert identifier(replace(integrators["ruth"], name=name)) == expected


def test_a_line_of_comment_does_not_swallow_the_next_one():
    assert comment(["a label\nof two lines", "LaTeX \\"], "//") == "// a label of two lines\n// LaTeX \\."
