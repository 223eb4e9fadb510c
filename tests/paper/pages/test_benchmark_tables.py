"""Tables that commands below benchmarks/ write to pages: each has their form, and the sentences beside it are so."""

from __future__ import annotations

import ast
import re
import sys

import numpy as np
import pytest

from support.results.stated_numbers import ROOT, flat, states
from support.results.tables_of_targets import MEASURED, benchmark, filled_by

TIMES = "docs/results/timings.md"
#: Page of each command that has one.
PAGES = {
    path.stem: value
    for path in (ROOT / "benchmarks").glob("*.py")
    for node in ast.parse(path.read_text(encoding="utf-8")).body
    if isinstance(node, ast.Assign) and [ast.unparse(one) for one in node.targets] == ["PAGE"]
    for value in [ast.literal_eval(node.value)]
}


def part(page, name):
    """A generated part of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return text.partition(f"<!-- {name} -->\n")[2].partition("\n<!-- end -->")[0]


def tables(text):
    """The tables of a part, each with its head and the cells of its rows, none of which is bold."""
    for table in re.findall(r"^\|.*\|\n\|[-:|]+\|\n((?:\|.*\|\n?)+)", text, re.MULTILINE):
        lines = table.replace("**", "").splitlines()
        yield [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def number(cell):
    """A number without its unit."""
    return float(cell.split()[0].replace(",", ""))


def of_beyond_double(module, text):
    return {
        name: {
            (target, label): number(cell) / 1e3
            for label, *cells in table
            for target, cell in zip(module.TARGETS, cells, strict=True)
            if cell != "not reached"
        }
        for name, table in zip(module.PROBLEMS, tables(text), strict=True)
    }


def of_kernels(module, text):
    (table,) = tables(text)
    rows = (dict(zip(module.FORMS, map(number, cells), strict=True)) for _, *cells in table)
    return dict(zip(module.SHOWN, rows, strict=True))


def of_larger_systems(module, text):
    (table,) = tables(text)
    keys = [(summation, key) for summation in module.SUMMATIONS for key in ("ours", *module.FLAGS)]
    return {
        name: {key: number(cell) / 1e6 for key, cell in zip(keys, cells, strict=True)} | {"first run": number(first)}
        for name, (_, *cells, first) in zip(module.CASES, table, strict=True)
    }


def of_stepper(module, text):
    (table,) = tables(text)
    found, each = {}, len(module.METHODS)
    assert len(table) == each * len(module.SETTINGS)
    for i, name in enumerate(module.SETTINGS):
        rows = table[each * i : each * (i + 1)]
        found[name] = {"by hand": number(rows[0][-1]) / 1e9}
        for method, (_, _, step, run, _) in zip(module.METHODS, rows, strict=True):
            found[name] |= {(method, "step"): number(step) / 1e9, (method, "run"): number(run) / 1e9}
    return found


def of_functions(module, text):
    (table,) = tables(text)
    unit = float(re.search(r"takes ([\d.]+) ns", text)[1])
    found = {("division", 8): unit}
    for name, double, extended in table:
        found[name.strip("`"), 8] = number(double) * unit
        found[f"{name.strip('`')}, double-double", 8] = number(extended) * unit
    return found


def of_large_grids(module, text):
    (table,) = tables(text)
    units = [1, 1, 1, 1, 1e-6, 1, 1, 1e6, 1]
    rows = [[number(cell) * unit for cell, unit in zip(row, units, strict=True)] for row in table]
    return [(int(runs), plan, int(shards), int(files), *more) for runs, plan, shards, files, *more in rows]


def of_trials(module, text):
    (table,) = tables(text)
    return {kind: {"tried": int(tried), "failed": int(failed)} for kind, tried, _, failed in table}


def of_samplers_in_libraries(module, text):
    (table,) = tables(text)
    targets = {label: name for name, label in module.TARGETS.items()}
    kinds = {label: kind for kind, (label, _) in module.SAMPLERS.items()}
    return {
        (targets[target], kinds[sampler]): {"gradients": number(gradients)}
        | {
            name: tuple(map(float, re.findall(r"[\d.]+", cell)))
            for name, cell in zip(module.METHODS[1:], cells, strict=True)
        }
        for target, sampler, gradients, *cells in table
    }


#: Command and part of its page -> function that reads the numbers back.
READ = {
    ("beyond_double", "extended"): of_beyond_double, ("kernels", "kernels"): of_kernels,
    ("larger_systems", "steps"): of_larger_systems, ("stepper", "steps"): of_stepper,
    ("functions", "costs"): of_functions, ("large_grids", "grids"): of_large_grids,
    ("trials", "quick"): of_trials, ("trials", "campaigns"): of_trials,
    ("samplers_in_libraries", "libraries"): of_samplers_in_libraries,
}  # fmt: skip


def test_tables_of_all_commands_are_read_back():
    assert {command for command, _ in READ} == set(PAGES)


@pytest.mark.parametrize(("command", "name"), READ)
def test_a_command_writes_tables_in_the_form_of_pages(command, name, monkeypatch):
    module = benchmark(command, monkeypatch)
    text = part(module.PAGE, name)
    machine = re.split("Machine: |Versions: ", text)[-1].removesuffix(".")
    given = name == "quick" if command == "trials" else machine
    assert module.parts(READ[command, name](module, text), given) == {name: text}


@pytest.mark.parametrize("command", sorted(PAGES))
def test_help_of_a_command_names_its_page(command, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [command, "--help"])
    with pytest.raises(SystemExit):
        benchmark(command, monkeypatch).main()
    assert f"write the tables to {PAGES[command]}," in " ".join(capsys.readouterr().out.split())


def test_a_page_keeps_its_tables_where_heyoka_is_missing(monkeypatch, tmp_path):
    own = {"henon_heiles": {(1e-18, "a"): 0.01}}
    monkeypatch.setitem(MEASURED, "beyond_double", own)
    with pytest.raises(SystemExit, match="the page stays as it is"):
        filled_by(["beyond_double"], "<!-- extended -->\nold\n<!-- end -->", monkeypatch, tmp_path)
    assert (tmp_path / TIMES).read_text(encoding="utf-8") == "<!-- extended -->\nold\n<!-- end -->"


def test_a_page_keeps_its_tables_where_no_case_was_counted(monkeypatch, tmp_path):
    monkeypatch.setitem(MEASURED, "trials", {})
    text = "<!-- quick -->\nold\n<!-- end -->"
    assert filled_by(["trials --quick"], text, monkeypatch, tmp_path) == text


def test_missing_libraries_of_samplers_are_named(monkeypatch):
    module = benchmark("samplers_in_libraries", monkeypatch)
    monkeypatch.setitem(sys.modules, "chains_of_libraries", None)
    with pytest.raises(SystemExit, match=r"pip install 'nearharmonic\[blackjax,mici\]'"):
        module.measured(short=True)


def test_gains_in_libraries_are_ratios_with_paired_intervals(monkeypatch):
    """Equal scatter of two methods on the same chains leaves their ratio without error."""
    module, scatter = benchmark("samplers_in_libraries", monkeypatch), np.array([0.0, 0.1, -0.1])
    found = module.gains({name: 4 - k + (k + 1) * scatter for k, name in enumerate(module.METHODS)})
    assert found["gradients"] == pytest.approx(np.exp(4))
    for k, name in enumerate(module.METHODS[1:], 1):
        half = 12.706 * k * 0.1  # the jackknife of two chains, Student's t with one degree of freedom
        assert np.log(found[name]) == pytest.approx(np.clip([k, k - half, k + half], -9, 9))


def test_page_of_releases_lists_the_commands_and_their_pages():
    page = (ROOT / "docs/developers/releasing.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"^\| `python benchmarks/(\w+)\.py --page` \| `(\S+)` \|", page, re.MULTILINE)) == PAGES


def test_order_ten_is_faster_than_heyoka_below_rounding(monkeypatch):
    module = benchmark("beyond_double", monkeypatch)
    assert "The method of order ten is faster than heyoka at each error" in flat(TIMES)
    for times in of_beyond_double(module, part(TIMES, "extended")).values():
        (ten,) = {label for _, label in times if label.endswith("order 10")}
        assert all(times[target, ten] < times[target, module.HEYOKA] for target in module.TARGETS)
    assert states(TIMES, [module.GRID + 1], "The error of heyoka is the maximum over", "times")


def test_one_trajectory_is_faster_when_looking_ahead(monkeypatch):
    module = benchmark("kernels", monkeypatch)
    assert "One trajectory is faster in this form, the widest lanes are not" in flat(TIMES)
    widest = max(module.WIDTHS)
    for (_, width, _), times in of_kernels(module, part(TIMES, "kernels")).items():
        if width in {1, widest}:
            assert (times["looking_ahead"] < times["as_written"]) == (width == 1)


def test_large_grids_end_at_the_time_of_the_page(monkeypatch):
    module = benchmark("large_grids", monkeypatch)
    (end,) = re.findall(r"t_end: (\d+)", module.CONFIG)
    assert f"on the Hénon-Heiles system, t = {end}," in flat(module.PAGE)
