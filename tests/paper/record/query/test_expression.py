"""Conditions on columns: those of Python's own evaluation of each row, and everything else refused with its place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.errors import NearharmonicError, UnknownNameError
from nearharmonic_paper.record.query import rows_where
from support.projects.call_counts import calls_of

COLUMNS = {
    "steps": np.array([1, 20, 300, 4000, 5, 60], dtype=np.int64),
    "error": np.array([1e-3, 1e-12, math.inf, math.nan, 0.0, 2.5]),
    "status": np.array(["ok", "ok", "diverged", "skipped", "ok", "diverged"]),
}
ROWS = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*(c.tolist() for c in COLUMNS.values()), strict=True)]


def by_python(text, rows):
    """Python's own verdict on each row."""
    return [bool(eval(text, {"inf": math.inf}, row)) for row in rows]


@pytest.mark.parametrize(
    "text",
    [
        "1 < steps <= 300 < 1e6",
        "status in ['ok', 'skipped']",
        "status not in ('ok',)",
        "steps in {5, 60.0}",
        "steps / 7 == 300 / 7",
        "error == inf",
        "steps * steps * steps * steps * steps * steps > 1e20",
        "  steps\n > 4  ",
        "1 < 2",
        "not 1 < 2",
        "+steps > 4",
    ],
)
def test_a_condition_is_pythons_own(text):
    assert rows_where(text, COLUMNS).tolist() == by_python(" ".join(text.split()), ROWS)


NUMBERS = st.one_of(st.sampled_from(["steps", "error"]), st.integers(0, 50).map(str), st.floats(0, 1e3).map(repr))
TERMS = st.recursive(
    NUMBERS, lambda t: st.builds("({} {} {})".format, t, st.sampled_from("+-*"), t) | st.builds("(-{})".format, t)
)
COMPARED = st.builds("{} {} {}".format, TERMS, st.sampled_from(["<", "<=", ">", ">=", "=="]), TERMS)
TEXTS = st.builds("status {} '{}'".format, st.sampled_from(["==", "!=", "<"]), st.sampled_from(["ok", "diverged"]))
CONDITIONS = st.recursive(
    COMPARED | TEXTS,
    lambda c: st.builds("({} {} {})".format, c, st.sampled_from(["and", "or"]), c) | st.builds("(not {})".format, c),
    max_leaves=6,
)


@pytest.mark.slow
@given(CONDITIONS)
def test_any_condition_is_pythons_own(text):
    assert rows_where(text, COLUMNS).tolist() == by_python(text, ROWS)


@pytest.mark.parametrize("text", ["error != 5", "error == error", "error < 1", "error > 1", "error not in [1, 2]"])
def test_a_comparison_with_nan_is_false(text):
    assert not rows_where(text, COLUMNS)[3]


def test_a_division_by_zero_is_no_error():
    assert rows_where("error / (steps - 1) == inf and 1 / 0 == inf", COLUMNS).tolist() == [True, False, True] + 3 * [
        False
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("__import__('os').remove('x')", "\"__import__('os').remove('x')\", at character 1, is not allowed"),
        ("steps > 1 and steps.real > 1", "'steps.real', at character 15, is not allowed"),
        ("steps[0] > 1", "'steps[0]', at character 1, is not allowed"),
        ("steps ** 2 > 1", "'steps ** 2', at character 1"),
        ("(lambda: 1) == 1", "'lambda: 1', at character 2"),
        ("steps is 1", "'1', at character 10, is not allowed"),
        ("True", "'True', at character 1, is not allowed"),
        ("error < 1e-9 and", "cannot be read at character 17"),
        ("status = 'ok'", "cannot be read at character 8: invalid syntax; equality is written =="),
        ("", "cannot be read at character 1"),
        ("steps", "is a number, not a condition"),
        (
            "steps and error > 1",
            "'steps', at character 1, is not allowed: it is a number, where a condition is expected",
        ),
        ("status < 3", "'3', at character 10, is not allowed: it is a number, and status is a text"),
        ("error == 'ok'", "\"'ok'\", at character 10, is not allowed: it is a text, and error is a number"),
        ("'é' == status and error == 'ok'", "at character 28, is not allowed"),
        ("status + 'x' == 'okx'", "'status', at character 1, is not allowed: it is a text, where a number is expected"),
        ("steps < (steps < 1)", "a condition cannot be compared"),
        ("status in 'ok'", "in takes a list of numbers or texts"),
        ("status in []", "in takes a list of numbers or texts"),
        ("steps in [steps]", "in takes a list of numbers or texts, no columns"),
        ("steps in ['ok']", "it is a text, and steps is a number"),
        (f"steps < 1{'0' * 400}", "larger than any number"),
        ("(" * 500 + "steps" + ")" * 500 + " > 1", "nested"),
        ("steps > 1\0", "cannot be read"),
        ("steps > @limit", "cannot be read"),
        ("index > 1", "unknown column 'index'"),
    ],
)
def test_anything_else_is_refused_with_its_place(text, says):
    with pytest.raises(NearharmonicError) as caught:
        rows_where(text, COLUMNS)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_backslash_in_a_text_is_no_warning():
    assert not rows_where(r"status == '\d'", COLUMNS).any()


@pytest.mark.parametrize("word", ["@steps", "`steps`", "a#b", "x' or steps > 0 or 'x", "{steps}", "ok\nok"])
def test_a_text_is_compared_as_it_stands(word):
    columns = {"status": np.array(["ok", word])}
    assert rows_where(f"status == {word!r}", columns).tolist() == [False, True]


def test_an_unknown_column_gets_its_nearest_match():
    with pytest.raises(UnknownNameError, match=r"unknown column 'errr'\. Did you mean 'error'\? Known: error, st"):
        rows_where("errr < 1", COLUMNS)


@pytest.mark.slow
def test_a_million_rows_take_as_many_calls_as_ten():
    def columns(rows):
        seed = np.random.default_rng(1)
        return {
            "error": 10 ** seed.uniform(-16, 0, rows),
            "integrator": np.array(["ruth", "babps9o7h"])[seed.integers(0, 2, rows)],
            "steps": seed.integers(1, 10**9, rows),
        }

    condition = "error < 1e-9 and integrator in ['ruth', 'aba104'] or not steps / 2 > 100"
    few, many = columns(10), columns(10**6)
    rows_where(condition, few)  # the first call of a process imports and compiles
    assert calls_of(lambda: rows_where(condition, many)) == calls_of(lambda: rows_where(condition, few))
    expected = (many["error"] < 1e-9) & (many["integrator"] == "ruth") | (many["steps"] <= 200)
    assert (rows_where(condition, many) == expected).all()
