"""Behind a figure and, as slow tests, behind other targets: each file is there and holds what was asked for."""

from __future__ import annotations

import csv
import json
import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread

from nearharmonic.output.store import groups_of, read
from nearharmonic.plotting.style import style_of
from nearharmonic_paper.claims.table import decided
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_studies.trained.comparison.contestants import contestants
from support.projects.targets import (
    DECOMPOSED,
    MADE,
    MADE_BY,
    METHODS,
    ON_CRYSTALS,
    RECORD,
    SAMPLING,
    SYSTEMS,
    TARGETS,
)

ROOT = Path(__file__).parents[2]
TINY = ("--configfile", "config/tiny.yaml")
RESULTS = "results/tiny/"
#: tabulate's LaTeX escapes, the longest first.
ESCAPES = [(r"\textasciitilde{}", "~"), (r"\textbackslash{}", "\\"), (r"\ensuremath{<}", "<"), (r"\ensuremath{>}", ">"),
           (r"\^{}", "^"), *((f"\\{mark}", mark) for mark in "&%$#_{}")]  # fmt: skip


def stems(suffix, made):
    return sorted(Path(name).stem for name in made if name.endswith(suffix))


def each(suffix):
    """Parameters (after, stem): files of a figure in README's command, those of other targets as slow tests."""
    first = stems(suffix, MADE_BY["all"])
    rest = sorted({*stems(suffix, MADE)} - {*first})
    cases = [("fig3", stem) for stem in stems(suffix, MADE_BY["fig3"])]
    cases += [pytest.param("all", stem, marks=pytest.mark.slow) for stem in first]
    cases += [pytest.param("everything", stem, marks=pytest.mark.slow) for stem in rest]
    return pytest.mark.parametrize(("after", "stem"), cases, indirect=["after"])


#: Table -> a column that no other table has, or the set of columns.
COLUMNS = {
    "derived_counts": "complex solutions", "derived_errors": "max error, Henon-Heiles", "derived_families": "set",
    "derived_orders": "lambda_max", "derived_routes": "restarts", "derived_solutions": "half of the outer row",
    "exact_oscillator": "T + V", "exact_oscillator_times": "ns_exact",
    "integrators": "generalised order", "kinetic_energy": "decline to A = 1", "library_times": "ratio_of_medians",
    "linear_stability": "stable to",
    "sixth_order_counts": "distinct solutions", "sixth_order_measured": "rank by maximum",
    "sixth_order_ranking": "nystrom_error", "stability_henon_heiles": "share_of_linear_limit",
    "stability_kepler": "e_0.000", "stability_rounding": "brouwer", "structure": "symplectic defect",
    "trained_landscape_light": "ended at the best", "trained_landscape_modified": "ended at the best",
    "trained_gains": "best trained", "trained_ideas": "ahead with T + V", "trained_long": "sum of coefficients",
    "trained_methods": "ahead_from", "trained_times": "charge_lanes",
    "table1_structure": "ABA d value", "table2_recursion": "tau^1", "table2_values": "tau^1",
    "table3_even_orders": "tau^4 as printed", "table4_coefficients": "printed", "table4_derived": "agreeing decimals",
}  # fmt: skip
#: Maps, paths, panels, and the best of many: a method has a place there, not a colour.
OF_NO_METHOD = (
    "henon_heiles_stability", "fig6_substeps", "fig6_displaced", "linear_stability", "crystals_map",
    "crystals_phonons", "crystals_gain", "samplers_trained",
)  # fmt: skip
#: Methods that a figure shows in place of those of the config.
SHOWN = {
    "fig2_decomposition": DECOMPOSED, "exact_oscillator_charge": ("aba864",), "crystals_error": ON_CRYSTALS,
    "crystals_long_runs": ("leapfrog", "trained_light"), "samplers_gaussian": SAMPLING, "samplers_targets": SAMPLING,
}  # fmt: skip


def compared(stem):
    """Names of the methods of a cube, in order; beside those of the config, two experiments have one found there."""
    found = {"crystals": (*ON_CRYSTALS, "trained_on_crystals"), "samplers": (*SAMPLING, "searched_s4")}
    return contestants() if stem == "trained" else found.get(stem, DECOMPOSED if stem == "sho_terms" else METHODS)


def text_of(project, name):
    return (project.folder / RESULTS / name).read_text(encoding="utf-8")


def test_every_file_is_there_and_no_other(after):
    folder = after.folder / RESULTS
    files = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    assert {name for name in files if not name.startswith("logs/")} == after.made | RECORD
    assert all(files[name].stat().st_size > 0 for name in after.made)


@pytest.mark.slow
def test_each_target_stands_for_its_files(drawn):
    done = drawn.snakemake(*TARGETS, "-n", "--forceall", "--quiet", "host", *TINY)
    assert done.returncode == 0, done.stdout
    blocks = dict(re.findall(r"^(?:local)?rule (\w+):\n((?: .*\n)+)", done.stdout, re.MULTILINE))
    assert set(blocks) >= set(TARGETS)
    for name, files in TARGETS.items():
        (listed,) = re.findall(r"^ +input: (.*)$", blocks[name], re.MULTILINE)
        assert {file.removeprefix(RESULTS) for file in listed.split(", ")} == files, name


@pytest.mark.slow
def test_statements_are_decided_on_what_is_there(everything):
    """The job ran before the other targets; after them no statement lacks a file, and few lack methods or steps."""
    before = json.loads(text_of(everything, "tables/claims.json"))
    now = json.loads(decided(everything.folder / RESULTS)["document"])
    assert [entry["id"] for entry in before] == [entry["id"] for entry in now]
    undecided = {entry["id"]: entry["value"] for entry in now if entry["verdict"] == "not decided here"}
    assert [value for value in undecided.values() if "is not there" in value] == []
    assert {"fig-1-sixth-order", "fig-5-best-mean"} <= set(undecided)
    of_other_targets = {"table-4-c3", "five-stage-solutions", "time-reversible", "compensated-summation"}
    assert {*of_other_targets, "minimised-coefficients"}.isdisjoint(undecided)


@pytest.mark.slow
def test_snakemake_summary_needs_no_number_of_cores(everything):
    """--summary, --list-changes and --report; by the first, every rule has run and none has to run again."""
    targets = ("everything", "trained")
    summary = everything.snakemake(*targets, "--summary", *TINY)
    assert summary.returncode == 0, summary.stdout
    rows = list(csv.DictReader(summary.stdout[summary.stdout.index("output_file") :].splitlines(), delimiter="\t"))
    assert {(row["status"], row["plan"]) for row in rows} == {("ok", "no update")}
    files = {row["output_file"].removeprefix(RESULTS) for row in rows}
    assert {name for name in files if not name.startswith("logs/compile/")} == MADE
    rules = re.findall(r"^\w+$", everything.snakemake("--list-rules", *TINY).stdout, re.MULTILINE)
    # Drawn or reduced where a config has regularised systems or runs in over ten files; documentation is no result.
    pages = {name for name in rules if name.startswith(("page", "picture"))} - {"page"}
    elsewhere = {"regularised_times_figure", "figure_of_regularised", "reduce_method"} | pages
    assert {row["rule"] for row in rows} == set(rules) - set(TARGETS) - elsewhere
    changes = everything.snakemake(*targets, "--list-changes", "code", *TINY)
    assert changes.returncode == 0, changes.stdout
    assert RESULTS not in changes.stdout
    report = everything.snakemake(*targets, "--report", "x.html", *TINY)
    assert report.returncode == 0, report.stdout
    page = (everything.folder / "x.html").read_text(encoding="utf-8")
    assert all(f"{stem}.png" in page for stem in stems(".png", MADE))


def kind_of(name):
    """Name of a result file with placeholders, as pages have it; None for those of the paper's systems."""
    of_paper = {("runs", system) for system in SYSTEMS} | {("cubes", f"{system}.h5") for system in SYSTEMS}
    if name.parts[:2] in of_paper:
        return None
    words = dict.fromkeys(METHODS, "integrator") | dict.fromkeys((*SYSTEMS, "relativistic_oscillator"), "autonomous")
    words |= {"argon": "crystal", "chain": "crystal", "lattice": "target", "mesquite": "target", "4_kick": "family"}
    ends = "|".join(words) if name.parts[0] == "runs" else "$."
    return str(name.with_stem(re.sub(f"(?:^|(?<=_))({ends})$", lambda end: f"{{{words[end[1]]}}}", name.stem)))


@pytest.mark.slow
def test_pages_name_every_variable_and_attribute_of_every_file(everything):
    """Those of the paper's systems are in the page on files, whose table test_generated_parts.py makes."""
    reference = (ROOT / "docs/reference/variables.md").read_text(encoding="utf-8")
    files = (ROOT / "docs/how_to/files.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## `(\S+)`\n(.*?)(?=^## |\Z)", reference, flags=re.MULTILINE | re.DOTALL))
    attributes = set(re.findall(r"^\| `(\w+)` \|", files.partition("## Attributes")[2], flags=re.MULTILINE))
    kinds, held = set(), set()
    for path in sorted((everything.folder / RESULTS).rglob("*.h5")):
        kind = kind_of(path.relative_to(everything.folder / RESULTS))
        kinds.add(kind)
        for group in groups_of(path) or (None,):
            found = read(path, group=group)
            held |= found.attrs.keys()
            for variable, told in found.variables.items() if kind else ():
                row = re.search(rf"^\| `{variable}` \| (.*?) \| (.*?) \| (.*) \|$", sections[kind], flags=re.MULTILINE)
                assert row, (kind, variable)
                assert row[1] == (", ".join(told.dims) or "none")
                assert row[2] in (told.attrs["units"], "unit of t")
                assert row[3].replace("\\", "") == told.attrs["long_name"]
    assert kinds == {*sections, None}
    of_own_systems = {"energy_floor", "energy_at_start", "energy_unit"}
    assert held == attributes - of_own_systems


def cells(line):
    return [cell.strip() for cell in line]


def markdown(text):
    lines = [
        line.strip().removeprefix("|").removesuffix("|").split("|") for line in text.splitlines() if line[:1] == "|"
    ]
    return [cells(line) for line in [lines[0], *lines[2:]]]


def latex(text):
    def plain(cell):
        for escaped, mark in ESCAPES:
            cell = cell.replace(escaped, mark)
        return cell

    lines = [line.rstrip().removesuffix("\\\\") for line in text.splitlines() if line.rstrip().endswith("\\\\")]
    return [cells(plain(cell) for cell in re.split(r"(?<!\\)&", line)) for line in lines]


def same(cell, shown):
    """True if ``shown`` is the CSV table's ``cell``, or its number to four digits."""
    try:
        return shown in (cell.strip(), f"{float(cell):.4g}")
    except ValueError:
        return shown == cell.strip()


@each(".tex")
def test_table_has_equal_rows_in_csv_markdown_and_latex(after, stem):
    header, *rows = table = list(csv.reader(text_of(after, f"tables/{stem}.csv").splitlines()))
    assert rows
    assert all(header)
    assert COLUMNS.get(stem, header[0]) in header
    for shown in (markdown(text_of(after, f"tables/{stem}.md")), latex(text_of(after, f"tables/{stem}.tex"))):
        assert [len(line) for line in shown] == [len(line) for line in table] == [len(header)] * (1 + len(rows))
        for line, shown_line in zip(table, shown, strict=True):
            assert all(map(same, line, shown_line)), (line, shown_line)
    # Under it stands a sentence of what it is; the methods of the config are in it, if it is one of methods.
    assert text_of(after, f"tables/{stem}.md").splitlines()[0].endswith((".", ";"))
    if header[0] == "integrator" or header[:2] == ["system", "integrator"]:
        assert set(METHODS) <= {row[header.index("integrator")] for row in rows}


@pytest.mark.slow
def test_tables_of_timings_have_rows_of_every_method_and_peer(everything):
    for system in SYSTEMS:
        rows = list(csv.DictReader(text_of(everything, f"tables/work_precision_{system}.csv").splitlines()))
        assert {row["system"] for row in rows} == {system}
        ends = {"sho": ("20", "20"), "henon_heiles": ("25", "20"), "kepler": ("4383", "4383")}[system]
        intervals = {(row["measure"], row["t_end"]) for row in rows}
        assert intervals == {("max", ends[0]), ("mean", ends[0]), ("position", ends[1])}
        assert {*METHODS, "aba864", "numpy_aba864", "numpy_babps9o7h"} == {row["method"] for row in rows}
        page = text_of(everything, f"tables/work_precision_{system}.md")
        assert all(f"| {label} |" in page for label in ("Ruth", "BABs7o7H", "ABA864"))


def test_no_two_figures_are_equal_except_those_with_two_names(after):
    second = {"fig1_sho": "sho", "fig3_henon_heiles": "henon_heiles", "fig5_kepler": "kepler"}
    pictures = {
        stem: (after.folder / RESULTS / f"figures/{stem}.png").read_bytes() for stem in stems(".png", after.made)
    }
    for stem, system in ((stem, system) for stem, system in second.items() if stem in pictures):
        assert pictures.pop(f"{system}_energy_error") == pictures[stem]
    assert len(set(pictures.values())) == len(pictures)


@pytest.mark.slow
@each(".png")
def test_a_figure_shows_its_methods_in_each_of_its_files(after, stem):
    place = after.folder / RESULTS / "figures"
    page = (place / f"{stem}.pdf").read_bytes()
    assert page.startswith(b"%PDF")
    assert page.rstrip().endswith(b"%%EOF")
    drawing = (place / f"{stem}.svg").read_text(encoding="utf-8")
    ET.fromstring(drawing)
    # Ink, and more colours than black, white and what lies between: an empty frame has neither.
    pixels = imread(place / f"{stem}.png")[..., :3]
    assert (pixels.min(axis=2) < 0.9).mean() > 0.01
    assert (np.ptp(pixels, axis=2) > 0.2).mean() > 1e-4
    if stem in OF_NO_METHOD or stem.startswith("trained_"):
        return
    methods = SHOWN.get(stem, METHODS)
    if stem.startswith("library_times"):  # those alone that win at some error
        assert any(style_of(name).colour in drawing for name in (*methods, "aba864"))
        return
    assert all(style_of(name).colour in drawing for name in methods)


@pytest.mark.slow
def test_the_documents_hold_coefficients_and_where_they_come_from(everything):
    for name, key in (("coefficients", "isolated"), ("sixth_order", "method")):
        document = tomllib.loads(text_of(everything, f"derived/{name}.toml"))
        assert {"package_version", "code_digest", "settings", "coefficients_digest"} <= set(document["provenance"])
        assert document[key]


def test_every_number_of_a_cube_is_there_for_each_method(after):
    for name in sorted(after.made):
        if not name.startswith("cubes/"):
            continue
        place = after.folder / RESULTS / name
        numbers, found = set(), set()
        for group in (None, *groups_of(place)):
            data = read(place, group)
            if "integrator" in data.dims:
                assert data.integrator.values.tolist() == list(compared(Path(name).stem)), name
            # Positions may be timed on an interval of their own.
            system = str(group).removesuffix("_position")
            for key, values in data.data_vars.items():
                if values.dtype.kind == "f":
                    numbers.add((system, key))
                    if np.isfinite(values).any():
                        found.add((system, key))
        # Adaptive peers alone have a tolerance, and registered methods that are trained a gain.
        assert {key for _, key in numbers - found} <= {"tolerance", "gain", "gain_interval"}, name


@pytest.mark.parametrize("experiment", experiments().values(), ids=lambda one: one.name)
@pytest.mark.slow
def test_cubes_have_the_dimensions_that_their_experiment_declares(everything, experiment):
    for stem, (dimensions, contents) in experiment.cubes.items():
        place = everything.folder / RESULTS / f"cubes/{stem}.h5"
        found = {name for group in (None, *groups_of(place)) for name in read(place, group).sizes}
        assert set(dimensions.partition(", in a group")[0].split(", ")) <= found, stem
        assert contents


def test_cubes_cover_the_grid_of_their_system(after):
    """The step sizes of the config, each method's of both shards: none lost, none twice."""
    given = yaml.safe_load((after.folder / "config/tiny.yaml").read_text(encoding="utf-8"))["systems"]
    for system, section in ((name, given[name]) for name in given if f"cubes/{name}.h5" in after.made):
        low, high, count = (section["tau_per_stage"][key] for key in ("lowest", "highest", "points_per_decade"))
        grid = [low * 10 ** (i / count) for i in range(100) if low * 10 ** (i / count) <= high * 1.0002]
        cube = read(after.folder / RESULTS / f"cubes/{system}.h5")
        assert cube.tau_per_stage.values == pytest.approx(grid, rel=1e-5), system
        assert cube.precision.values.tolist() == (["double", "extended"] if system == "sho" else ["double"])
        if system == "sho":
            assert "ok" in cube.status.sel(precision="extended")
        steps, status = (values.sel(precision="double") for values in (cube.steps, cube.status))
        assert set(np.unique(status)) <= {"ok", "diverged"}, system
        for method, stages in (("ruth", 3), ("babs7o7h", 7)):
            taken = [max(1, round(section["t_end"] / (tau * stages))) for tau in cube.tau_per_stage.values]
            assert steps.sel(integrator=method).values.tolist() == taken, (system, method)
