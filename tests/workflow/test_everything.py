"""Behind a figure and, as slow tests, behind other targets: each file is there and holds what was asked for."""

import csv
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread

from nearharmonic.output.store import groups_of, read
from nearharmonic.plotting.style import style_of
from nearharmonic_paper.claims.table import decided
from nearharmonic_studies.trained.settings import contestants
from support.projects.targets import DECOMPOSED, MADE, MADE_BY, METHODS, ON_CRYSTALS, RECORD, SAMPLING, TARGETS

ROOT = Path(__file__).parents[2]
TINY = ("--configfile", "config/tiny.yaml")
RESULTS = "results/tiny/"


def stems(suffix, made):
    return sorted(Path(name).stem for name in made if name.endswith(suffix))


def each(suffix):
    """Parameters (after, stem): files of a figure in README's command, files of other targets as slow tests."""
    first = stems(suffix, MADE_BY["all"])
    rest = sorted({*stems(suffix, MADE)} - {*first})
    cases = [("fig3", stem) for stem in stems(suffix, MADE_BY["fig3"])]
    cases += [pytest.param("all", stem, marks=pytest.mark.slow) for stem in first]
    cases += [pytest.param("everything", stem, marks=pytest.mark.slow) for stem in rest]
    return pytest.mark.parametrize(("after", "stem"), cases, indirect=["after"])


#: Maps, paths, panels, and the best of many: a method has a place there, not a colour.
OF_NO_METHOD = (
    "henon_heiles_stability", "fig6_substeps", "fig6_displaced", "linear_stability", "crystals_map",
    "crystals_phonons", "crystals_gain", "samplers_trained",
)  # fmt: skip
#: Methods that a figure shows in place of the config's.
SHOWN = {
    "fig2_decomposition": DECOMPOSED, "exact_oscillator_charge": ("aba864",), "crystals_error": ON_CRYSTALS,
    "crystals_long_runs": ("leapfrog", "trained_light"), "samplers_gaussian": SAMPLING, "samplers_targets": SAMPLING,
}  # fmt: skip


def compared(stem):
    """Names of the methods of a cube, in order; besides the config's, two experiments have one found there."""
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
        asked = {file.removeprefix(RESULTS) for file in listed.split(", ")}
        assert {file for file in asked if not file.endswith(".done")} == files, name


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
    assert {name for name in files if not name.startswith("logs/")} == MADE
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


def test_no_two_figures_are_equal(after):
    pictures = [(after.folder / RESULTS / f"figures/{stem}.png").read_bytes() for stem in stems(".png", after.made)]
    assert len(set(pictures)) == len(pictures)


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
    stem = stem.removesuffix("_column")
    if stem in OF_NO_METHOD or stem.startswith("trained_"):
        return
    methods = SHOWN.get(stem, METHODS)
    if stem.startswith("library_times"):  # those alone that win at some error
        assert any(style_of(name).colour in drawing for name in (*methods, "aba864"))
        return
    assert all(style_of(name).colour in drawing for name in methods)


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
