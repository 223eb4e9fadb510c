"""Single runs: conditions, and runs integrated again."""

import math
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.engine.settings import Sweep
from nearharmonic.errors import NearharmonicError, ResultFileError, UnknownNameError
from nearharmonic.output import store
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.query import rerun, rows_where
from nearharmonic_paper.tasks.job import write
from nearharmonic_paper.tasks.provenance import Receipt, function_of, provenance, task
from support.hostile.mutations import ODD_SETTINGS
from support.projects.call_counts import calls_of
from support.results.result_folder import edited

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
        "1 < steps <= 300 < 1e6", "status in ['ok', 'skipped']", "status not in ('ok',)", "steps in {5, 60.0}",
        "steps / 7 == 300 / 7", "error == inf", "steps * steps * steps * steps * steps * steps > 1e20",
        "  steps\n > 4  ", "1 < 2", "not 1 < 2", "+steps > 4",
    ],
)  # fmt: skip
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
    found = rows_where("error / (steps - 1) == inf and 1 / 0 == inf", COLUMNS)
    assert found.tolist() == [True, False, True, False, False, False]


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


# --- Runs integrated again have the bits of their files, and a bit that differs is named.

SWEEP = Sweep(
    system="sho", t_end="10", lowest=0.003, highest=1.5, points_per_decade=5, precision=("double", "extended"),
    summation="compensated", samples=20, shards=2,
)  # fmt: skip


@pytest.fixture
def results(tmp_path, monkeypatch):
    """Two run files, as the workflow makes them."""
    monkeypatch.chdir(tmp_path)
    return made(tmp_path, SWEEP, "run:integrate")


def made(tmp_path, sweep, function):
    folder = tmp_path / "results/paper"
    (folder / "logs").mkdir(parents=True)
    for shard in (0, 1):
        described = task(
            f"nearharmonic_paper.experiments.paper.{function}", sweep=sweep, integrator="babs7o7h", shard=shard
        )
        place = f"results/paper/runs/sho/babs7o7h/{shard}.h5"
        write(function_of(described)(**described["settings"])["run"], [place], provenance(described))
        receipt = Receipt(f"results/paper/logs/{shard}.log")
        receipt.add([place], described)
        receipt.write()
    manifest.write(folder)
    return folder


def sizes(folder):
    """Runs in each precision of all files."""
    found = []
    for path in sorted(folder.rglob("*.h5")):
        with h5py.File(path) as file:
            found += [int((group["steps"][()] > 0).sum()) for group in (file, file.get("extended")) if group]
    return found


@pytest.mark.slow
def test_every_run_has_the_same_bits_again(results):
    """Alone as well as in lanes beside others, and short ones, which have fewer samples."""
    again = rerun(results, 1000)
    assert len(again) == sum(sizes(results)) > 6
    assert {run.precision for run in again} == {"double", "extended"}
    assert [run.differs for run in again] == [()] * len(again)


@pytest.mark.slow
def test_run_without_samples_has_the_same_numbers_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = made(tmp_path, replace(SWEEP, samples=0), "reductions:integrate_and_reduce")
    again = rerun(folder, 1000)
    assert len(again) == sum(sizes(folder)) > 6
    assert [run.differs for run in again] == [()] * len(again)


@pytest.mark.slow
@pytest.mark.parametrize("settings", ODD_SETTINGS)
def test_settings_of_no_run_are_one_sentence(results, settings):
    for path in results.rglob("*.h5"):
        with edited(path) as file:
            file.attrs["settings"] = settings
    with pytest.raises(ResultFileError, match=r"0\.h5 has .*settings.* Make it again"):
        rerun(results, 1000)


@pytest.mark.slow
def test_draw_has_requested_size_and_depends_on_seed(results):
    assert len(rerun(results, 3)) == 3
    assert rerun(results, 3, seed=1) == rerun(results, 3, seed=1)
    assert len({tuple((r.file, r.precision, r.tau_per_stage) for r in rerun(results, 3, seed=s)) for s in range(6)}) > 1


def rewritten(results, change):
    """The first run file with both precisions, its variables in double precision changed."""
    place = next(p for p in sorted((results / "runs").rglob("*.h5")) if store.groups_of(p))
    kept = store.read(place)
    root = {name: (v.dims, v.values, v.attrs) for name, v in kept.variables.items()}
    change(root)
    more = {name: (v.dims, v.values, v.attrs) for name, v in store.read(place, "extended").variables.items()}
    attributes = {key: value for key, value in kept.attrs.items() if key not in {"format", "Conventions"}}
    store.write(place, root, attributes, {"extended": more})
    return place.relative_to(results).as_posix()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["q", "block_max_energy_error", "steps", "block_steps"])
def test_a_number_that_differs_in_its_last_bit_is_named(results, name):
    def change(variables):
        first = variables[name][1].reshape(-1)[:1]
        first[:] = first + 1 if first.dtype.kind == "i" else np.nextafter(first, np.inf)

    file = rewritten(results, change)
    differing = [run for run in rerun(results, 1000) if run.differs]
    assert [(run.file, run.precision, run.differs) for run in differing] == [(file, "double", (name,))]


@pytest.mark.slow
@pytest.mark.parametrize("change", [lambda v: v.pop("steps"), lambda v: v.update(more=v["steps"])])
def test_a_variable_that_one_of_them_lacks_is_named(results, change):
    file = rewritten(results, change)
    differing = {(run.file, run.precision): run.differs for run in rerun(results, 1000) if run.differs}
    assert list(differing) == [(file, "double")]
    assert differing[file, "double"] in {("steps",), ("more",)}


def test_a_damaged_run_file_is_named(results):
    (results / "runs/sho/babs7o7h/0.h5").write_bytes(b"?")
    with pytest.raises(ResultFileError, match=r"0\.h5 is truncated or no result file"):
        rerun(results, 1)
