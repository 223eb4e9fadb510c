"""Relative differences, against exact fractions; datasets of unlike coordinates; columns of tables."""

import math
import re
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr
from hypothesis import example, given
from hypothesis import strategies as st

from nearharmonic.errors import ResultFileError
from nearharmonic_paper.record import compare
from nearharmonic_paper.record.manifest import Texts

NUMBERS = st.floats(allow_nan=True, allow_infinity=True, allow_subnormal=True)


def exact(a, b):
    """|a - b| / max(|a|, |b|) by fractions; infinite where one alone is no finite number, or the infinities differ."""
    if a == b or (math.isnan(a) and math.isnan(b)):
        return 0
    if not (math.isfinite(a) and math.isfinite(b)):
        return math.inf
    one, other = Fraction(a), Fraction(b)
    return float(abs(one - other) / max(abs(one), abs(other)))


@pytest.mark.slow
@given(NUMBERS, NUMBERS)
@example(1.7e308, -1.7e308)
def test_relative_difference_is_exact_and_zero_only_for_equal_numbers(a, b):
    (found,) = compare.relative_differences(np.array([a]), np.array([b])).tolist()
    # Three roundings, of a - b, of the quotient and of the doubling; halves of subnormal numbers lose a bit.
    tiny = max(abs(a), abs(b)) < 1e-300
    assert found == pytest.approx(exact(a, b), rel=1 if tiny else 1e-15)
    assert (found == 0) == (exact(a, b) == 0)


def test_whole_numbers_beyond_doubles_are_told_apart():
    a, b = np.array([2**60, 5]), np.array([2**60 + 1, 5])
    assert (compare.relative_differences(a, b) > 0).tolist() == [True, False]


def test_largest_difference_is_reported_with_place_and_count():
    a = np.array([[1.0, np.nan, 3.0], [4.0, np.inf, 0.0]])
    b = np.array([[1.0, np.nan, 3.3], [8.0, np.inf, 0.0]])
    found = compare.array_difference("x", a, b, [("method", ["p", "q"]), ("tau", [0.1, 0.2, 0.3])], unit="h")
    assert (found.kind, found.a, found.b, found.relative) == ("number", 4.0, 8.0, 0.5)
    assert dict(found.at) == {"method": "q", "tau": 0.1}
    assert (found.differ, found.compared, found.unit) == (2, 6, "h")
    assert compare.array_difference("x", a, a.copy(), []) is None


def test_nan_beside_number_is_largest_difference_of_all():
    found = compare.array_difference("x", np.array([1.0, np.nan]), np.array([2.0, 5.0]), [("tau", [1, 2])])
    assert (found.relative, found.b, dict(found.at)) == (math.inf, 5.0, {"tau": 2})


def dataset(methods, taus, offset=0.0, **more):
    values = [[10.0 * i + j for j, _ in enumerate(taus)] for i, _ in enumerate(methods)]
    for i, method in enumerate(methods):
        values[i] = [len(method) + tau + offset for tau in taus]
    over = ("method", "tau")
    return xr.Dataset(
        {"error": (over, values, {"units": "1"}), **more},
        coords={"method": list(methods), "tau": ("tau", list(taus), {"units": "h"})},
    )


def told(a, b, leave_out=()):
    return list(compare.dataset_differences("cube.h5", a, b, leave_out))


def test_values_are_compared_on_common_coordinates_in_any_order():
    a, b = dataset(["ruth", "aba"], [1.0, 2.0, 3.0]), dataset(["aba", "verlet", "ruth"], [3.0, 1.0, 7.0])
    assert [(d.kind, d.where, d.a, d.b, d.unit) for d in told(a, b)] == [
        ("missing", "cube.h5: method", "no more", "also verlet", ""),
        ("missing", "cube.h5: tau", "also 2", "also 7", "h"),
    ]
    b.error[0, 1] = 100.0
    found = told(a, b)[-1]
    assert (found.where, found.a, found.b, found.differ, found.compared) == ("cube.h5: error", 4.0, 100.0, 1, 4)
    assert dict(found.at) == {"method": "aba", "tau": 1.0}
    assert dict(found.at_units) == {"tau": "h"}


def test_many_values_of_one_alone_are_told_as_a_range():
    a, b = dataset(["ruth"], np.arange(1.0, 20.0)), dataset(["ruth"], [5.0])
    assert told(a, b)[0].a == "also 18 from 1 to 19"
    assert told(b, a)[0].b == "also 18 from 1 to 19"


def test_dimension_without_coordinates_is_compared_as_far_as_both_reach():
    a = xr.Dataset({"x": ("sample", [1.0, 2.0, 3.0])})
    b = xr.Dataset({"x": ("sample", [1.0, 5.0])})
    lengths, values = told(a, b)
    assert (lengths.kind, lengths.where, lengths.a, lengths.b) == ("missing", "cube.h5: sample", "also 2", "no more")
    assert (values.relative, values.compared, dict(values.at)) == (0.6, 2, {"sample": 1})


def test_variables_of_one_alone_or_over_other_dimensions_are_told():
    a = dataset(["ruth"], [1.0], extra=("tau", [1.0]), shape=("tau", [1.0]))
    b = dataset(["ruth"], [1.0], shape=((), 1.0))
    assert [(d.kind, d.where, d.a, d.b) for d in told(a, b)] == [
        ("missing", "cube.h5: extra", "there", "missing"),
        ("missing", "cube.h5: shape", "over tau", "a single value"),
    ]
    assert told(a, b, {"extra", "shape"}) == []


def test_texts_and_units_that_differ_are_told():
    a = dataset(["ruth"], [1.0, 2.0], status=("tau", ["ok", "ok"]), note=("tau", ["x", "y"]))
    b = dataset(["ruth"], [1.0, 2.0], status=("tau", ["ok", "diverged"]), note=("tau", ["x", "z"]))
    b.error.attrs["units"] = "h"
    assert [(d.kind, d.where, d.a, d.b, d.differ) for d in told(a, b)] == [
        ("text", "cube.h5: error, unit", "1", "h", None),
        ("status", "cube.h5: status", "ok", "diverged", 1),
        ("text", "cube.h5: note", "y", "z", 1),
    ]


def tables(tmp_path, a, b, leave_out=()):
    folders = [tmp_path / name for name in ("a", "b")]
    for folder, text in zip(folders, (a, b), strict=True):
        folder.mkdir(exist_ok=True)
        (folder / "t.csv").write_text(text)
    return list(compare.table_differences("t.csv", *map(Texts, folders), leave_out))


def test_column_of_table_is_compared_with_all_its_digits(tmp_path):
    one, other = f"0.{'1' * 70}", f"0.{'1' * 69}2"
    (found,) = tables(tmp_path, f"name,x\np,1.0\nq,{one}\n", f"name,x\np,1\nq,{other}\n")
    assert (found.kind, found.where, found.a, found.b) == ("number", "t.csv: x", one, other)
    assert found.relative == pytest.approx(9e-70, rel=1e-12)
    assert (dict(found.at), found.differ, found.compared) == ({"row": "q"}, 1, 2)


def test_difference_in_a_table_is_relative_to_the_larger_number(tmp_path):
    (found,) = tables(tmp_path, "name,x\np,1\n", "name,x\np,-4\n")
    assert found.relative == 5 / 4


def test_rows_belong_together_by_name_whatever_their_order(tmp_path):
    found = tables(tmp_path, "name,x\np,1\nq,2\nr,nan\n", "name,x\nr,nan\ns,7\np,4\n")
    assert [(d.kind, d.where, d.a, d.b) for d in found] == [
        ("missing", "t.csv: rows", "1 more", "1 more"),
        ("number", "t.csv: x", 1.0, 4.0),
    ]


def test_rows_without_names_belong_together_by_number(tmp_path):
    found = tables(tmp_path, "i,x\n1,1\n2,2\n", "i,x\n1,1\n2,inf\n3,4\n")
    assert [(d.where, d.a, d.b, dict(d.at)) for d in found] == [
        ("t.csv: rows", "no more", "1 more", {}),
        ("t.csv: x", 2.0, math.inf, {"row": "2"}),
    ]


def test_table_comparison_covers_texts_and_columns_except_skipped_ones(tmp_path):
    a, b = "name,proved,s,old\np,yes,1.5,1\n", "name,proved,s,new\np,no,2.5,1\n"
    assert [(d.kind, d.where, d.a, d.b) for d in tables(tmp_path, a, b, {"s"})] == [
        ("missing", "t.csv: old", "there", "missing"),
        ("missing", "t.csv: new", "missing", "there"),
        ("text", "t.csv: proved", "yes", "no"),
    ]


def test_empty_cell_differs_from_number_and_from_no_empty_cell(tmp_path):
    (found,) = tables(tmp_path, "name,x\np,\nq,\n", "name,x\np,\nq,1\n")
    assert (found.relative, found.a, found.b, found.differ) == (math.inf, "", 1.0, 1)


@pytest.mark.parametrize("text", ["", "a,b\n1\n", "a\n\xff"])
def test_a_file_that_is_no_table_is_named(tmp_path, text):
    for name, content in {"a": text.encode("latin-1"), "b": b"a,b\n1,2\n"}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "t.csv").write_bytes(content)
    with pytest.raises(ResultFileError, match=re.escape(f"{tmp_path}/a/t.csv ")):
        list(compare.table_differences("t.csv", Texts(tmp_path / "a"), Texts(tmp_path / "b"), ()))
