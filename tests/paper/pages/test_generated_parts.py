"""Generated parts of pages: small inputs give the lines that they should; what is cheap to make stands in the pages."""

import re
import xml.etree.ElementTree as ET
from functools import partial
from html import unescape
from runpy import run_path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED
from nearharmonic.output.table import filled, short
from nearharmonic.plotting.style import new_figure, style_of
from nearharmonic.recommendation.measure import Solver, curves_of, dataset_of
from nearharmonic_paper.pages import library, targets
from nearharmonic_paper.pages.filling import rows_of
from nearharmonic_paper.report.shown import drawn
from nearharmonic_studies.crystals import results as of_crystals
from nearharmonic_studies.samplers.results import page as samplers
from nearharmonic_studies.trained.page import page as trained
from nearharmonic_studies.trained.page import training
from support.cubes.artists import luminance
from support.results import page_inputs
from support.results.page_inputs import LINES, TABLES
from support.results.recorded_results import unpack
from support.results.stated_numbers import ROOT

DOCS = ROOT / "docs"
PAGES = {path.stem: path for path in DOCS.glob("*/*.md") if "<!-- end -->" in path.read_text(encoding="utf-8")}
EXAMPLES = sorted(map(str, (ROOT / "examples").glob("*.py")))


def text_of(name):
    return PAGES[name].read_text(encoding="utf-8")


def parts(text):
    return dict(re.findall(r"<!-- (?!end )([\w-]+) -->\n(.*?)\n<!-- end -->", text, re.DOTALL))


def of_tables(function, name, folder):
    """A page of tables in CSV."""
    for stem, text in TABLES[name].items():
        (folder / f"{stem}.csv").write_text(text)
    return function(str(PAGES[name]), tables=sorted(map(str, folder.glob("*.csv"))))


def of_cube(function, name, write, folder):
    """A page of a cube."""
    write(folder / "cube.h5")
    return function(str(PAGES[name]), cube=str(folder / "cube.h5"))


def of_training(folder):
    (folder / "light.csv").write_text(TABLES["training"]["light"])
    return training(str(PAGES["training"]), light=str(folder / "light.csv"))


def of_files(folder):
    for name, unit in {"sho": "1", "kepler": "h"}.items():
        page_inputs.write_variables(folder / f"{name}.h5", unit)
    places = sorted(map(str, folder.glob("*.h5")))
    return library.files(str(PAGES["files"]), runs=places, cubes=places)


def of_variables(folder):
    page_inputs.write_variables(folder / "x.h5", "1", meaning="a|b_c", name="x", dimension="point")
    page = str(PAGES["variables"])
    return library.variables(page, files=[str(folder / "x.h5")], kinds=["x.h5"], explained=str(PAGES["files"]))


def of_regularised(folder):
    names = ("kepler", "kepler_regularised")
    page_inputs.write_times(folder / "cube.h5", names)
    return targets.regularised(str(PAGES["regularised"]), cube=str(folder / "cube.h5"), names=names)


MADE = {
    "stability": partial(of_tables, targets.stability, "stability"),
    "derivation": partial(of_tables, targets.derivation, "derivation"),
    "trained": partial(of_tables, trained, "trained"),
    "exact_oscillator": partial(of_cube, targets.exact_oscillator, "exact_oscillator", page_inputs.write_crossings),
    "samplers": partial(of_cube, samplers, "samplers", page_inputs.write_samplers),
    "timings": partial(
        of_cube, targets.timings, "timings", partial(page_inputs.write_times, names=("sho", "henon_heiles", "kepler"))
    ),
    "training": of_training, "files": of_files, "variables": of_variables, "regularised": of_regularised,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_small_inputs_give_these_lines_and_the_text_stays(name, tmp_path):
    made = MADE[name](tmp_path)["page"]
    assert filled(made, parts(text_of(name))) == text_of(name)
    found = parts(made)
    for part, lines in LINES[name].items():
        assert f"\n{lines}\n" in f"\n{found[part]}\n", found[part]


@pytest.mark.slow
def test_crystals_show_leads_in_decades(monkeypatch):
    place = ROOT / "tests/studies/crystals/example_cubes.py"
    names = ("leapfrog", "babps9o7h", "trained_light", "trained_on_crystals")
    cube = run_path(str(place))["crystals"](names)
    monkeypatch.setattr(of_crystals, "read", {"cube": cube}.get)
    found = parts(of_crystals.page(str(PAGES["crystals"]), cube="cube")["page"])
    one = cube.isel(crystal=0, temperature=0)
    forces = of_crystals.nearest(cube, "forces", 26)
    lead = np.log10(
        one.max_energy_error.sel(quantile=0.5, forces=forces).sel(integrator=[*names[:3]]).min()
        / one.max_energy_error.sel(quantile=0.5, forces=forces, integrator=names[3])
    )
    cells = [cell.strip() for cell in found["trained"].splitlines()[2].split("|")]
    assert cells[4] in (f"{float(lead):+.1f}".replace("-", "−"), "–")
    assert f" {float(one.lead.sel(forces=forces)):.1f} |" in found["leaders"].splitlines()[2]
    largest = float(abs(cube.drift).isel(drifting=0, crystal=0).max())
    assert found["drift"].splitlines()[2].split(" | ")[1].removesuffix(" |") == short(largest, 1)
    exact = cube.potential.sel(averaged="leapfrog", bath="middle", spacing=cube.spacing.max())
    ends = cube.potential.isel(averaged=-1).sel(bath="ends").sel(spacing=14, method="nearest")
    assert found["averages"].splitlines()[-1].split(" | ")[2] == f"{100 * (float(ends / exact) - 1):+.1f}"
    errors = (
        cube.max_energy_error.sel(quantile=0.5, forces=forces).sel(temperature=0.1, method="nearest").isel(crystal=0)
    )
    cells = found["errors"].splitlines()[2].strip("| ").split(" | ")
    assert cells[3:5] == [short(float(errors.sel(integrator="leapfrog")), 2)] * 2  # the only general one
    assert cells[5:] == [short(float(errors.sel(integrator=name)), 2) for name in names[1:3]]


# --- what stands in the pages is what is made -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return unpack(tmp_path_factory.mktemp("recorded"))


def test_solutions_of_the_derivation_are_those_recorded(recorded):
    page = targets.derivation(str(PAGES["derivation"]), tables=[*map(str, recorded.glob("tables/derived_*.csv"))])
    assert page["page"] == text_of("derivation")


def test_tables_of_files_beside_pages_stand_in_the_pages(monkeypatch):
    monkeypatch.setattr(library, "drawn", lambda figure: figure)
    page = library.adapters(str(PAGES["adapters"]), errors=str(DOCS / "how_to/adapters.csv"))
    assert page["page"] == text_of("adapters")
    axes = page["figure"].axes[0]
    first = [line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 1][:3]
    assert first == pytest.approx([1, 1.6e-6 / 2.9e-3, 2.6e-7 / 2.9e-3])
    rows = rows_of(str(DOCS / "results/regularised.csv"))
    assert targets.regularised_tables(rows) == parts(text_of("regularised"))["times"]


def test_gallery_has_the_lines_of_each_example(monkeypatch):
    monkeypatch.setattr(library, "picture_drawn", lambda place: b"")
    assert library.gallery(str(PAGES["gallery"]), files=EXAMPLES)["page"] == text_of("gallery")


@pytest.mark.slow
def test_tables_of_registered_methods_stand_in_the_pages():
    assert library.methods(str(PAGES["methods"]))["page"] == text_of("methods")
    made = parts(training(str(PAGES["training"]))["page"])
    assert [made[name] == parts(text_of("training"))[name] for name in ("methods", "shifted")] == [True, True]


# --- what commands below benchmarks/ measure --------------------------------------------------------------------------


def test_method_reaches_an_error_where_all_finer_runs_meet_it():
    reached = page_inputs.benchmark("ranking").reached
    columns = {"steps": [10, 20, 40, 80], "evaluations": [100, 200, 400, 800], "compensated": [0, 0, 0, 1]}
    columns |= {"tau": [8, 4, 2, 1], "max_energy_error": [1e-2, 1e-5, 1e-4, 1e-6]}
    (curve,) = curves_of(dataset_of([Solver(method="ruth", label="Ruth", kind="splitting", columns=columns)], "1"))
    assert reached(curve, 1e-5) == (pytest.approx(400 * np.sqrt(2)), "ruth", 80, "compensated")
    assert reached(curve, 1e-2) == (100, "ruth", 10, "plain")
    assert reached(curve, 1e-7) is None


@pytest.mark.parametrize("cell", [("henon_heiles", 1e-3), ("kepler", 1e-3), ("henon_heiles", 1e-6)])
def test_call_of_a_cell_meets_its_error_with_stated_evaluations(cell):
    rows = rows_of(str(DOCS / "start/which_method.csv"))
    text = parts(text_of("choosing"))["which-method"]
    assert text == page_inputs.benchmark("which_method").cells(rows)
    shown = re.findall(r'data-call="(.*?)".*?([\d\u202f]+) evaluations', text)
    call, evaluations = shown[[(row["system"], row["error"]) for row in rows].index(cell)]
    run = exec(unescape(call), made := {}) or made["run"]
    assert (run.max_energy_error <= cell[1], run.evaluations) == (True, int(evaluations.replace("\u202f", "")))


def test_words_in_cells_contrast_with_colours_of_families():
    style = (DOCS / "_static/site.css").read_text(encoding="utf-8")
    colours = re.findall(r"^\.which-method .*background: (#\w+)", style, re.MULTILINE)
    assert len(colours) == 5
    assert all(1.05 / (luminance(colour) + 0.05) >= 4.5 for colour in colours)  # white words


@pytest.mark.slow
def test_evaluations_of_the_ranking_are_those_of_runs():
    ranking = page_inputs.benchmark("ranking")
    row = re.search(r"^\| 1e-06 \| (.*?) \|", text_of("ranking"), re.MULTILINE)[1]
    _, system, t_end = ranking.contests()[0]
    cells = [cell.rsplit(" ", 1) for cell in row.split(", ")]
    names = [next(name for name, one in nh.integrators.items() if one.label == label) for label, _ in cells]
    for (_, count), curve in zip(cells, ranking.curves(system, t_end, names), strict=True):
        place = ranking.reached(curve, 1e-6)
        assert f"{place.evaluations:.0f}" == count
        run = nh.integrate(system, place.method, float(t_end) / place.steps, t_end=t_end, samples=2)
        assert run.max_energy_error <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings", "line"),
    [
        ("gauss", {"AMPLITUDES": (0.1,), "TIMES": (4, 8, 16), "ORBITS": 2}, "| 0.1 | 280 | 9.8 | 7.5 | 24% |"),
        ("tangent_maps", {"SIZE": 12, "T_END": 100}, "| 1/6 | 100 | 79 % |"),
        ("tabulated_potentials", {"LADDER": np.geomspace(1e-3, 0.1, 12)}, "| 4 | 0.00042 | 0.00026 |"),
        pytest.param(
            "tailor",
            {"TAILORED": ("henon_heiles",), "TRIALS": 60, "OVER": (("henon_heiles", 4),), "STARTS": (2,), "DRAWS": 1,
             "OVER_TRIALS": 60, "OTHER_STEPS": (0.1,), "OTHER_ENERGIES": (0.125,)},
            "| H | 0.125 |", marks=pytest.mark.long,
        ),
    ],
)  # fmt: skip
def test_pages_on_use_are_measured_with_small_settings(name, settings, line, monkeypatch, tmp_path):
    module = page_inputs.benchmark(name)
    for setting, few in settings.items():
        monkeypatch.setattr(module, setting, few)
    (tmp_path / "how_to").mkdir()
    monkeypatch.setattr("sys.argv", [name, "--page", str(tmp_path)])
    module.fill(module.__doc__, module.parts, module.PAGE, getattr(module, "PICTURE", None))
    made = (tmp_path / f"how_to/{name}.md").read_text(encoding="utf-8")
    assert filled(made, parts(text_of(name))) == text_of(name)
    assert line in made
    assert [path.name for path in tmp_path.glob("*/*.svg")] == [f"{name}.svg"] * (name != "tailor")


def test_largest_steps_and_slopes_are_those_of_powers():
    module = page_inputs.benchmark("tabulated_potentials")
    steps = module.LADDER
    errors = {"babps8o7h": {form: steps**power for power, form in enumerate(module.FORMS, 3)}}
    rows = list(module.steps_to_errors(errors))
    assert [row[2] for row in rows] == ["3.0", "4.0", "5.0"]
    largest = steps[steps**3 <= 1e-6].max()
    assert rows[0][3] == f"{largest:.2g}"
    assert rows[1][3] == f"{steps[steps**4 <= 1e-6].max():.2g} ({largest / steps[steps**4 <= 1e-6].max():.2g})"


@pytest.mark.slow
def test_gains_on_examples_are_ratios_of_the_smallest_errors():
    module = page_inputs.benchmark("near_harmonic")
    errors = dict.fromkeys(module.others(), 1e-4) | dict.fromkeys(module.NEW, 1e-5)
    results = [
        module.Result(orbit=orbit, delta=delta, errors=dict.fromkeys(module.COSTS, errors))
        for orbit, delta in zip(module.families(module.examples_in(EXAMPLES)), (1e-3, 0.05, 0.3, 0.9), strict=False)
    ]
    assert module.table_of_bands(results).count("+1.0 / **+1.0** / +1.0") == 4 * 2 * 3
    assert module.table_of_families(results).splitlines()[-1].endswith("| 0.9 |" + " +1.0 |" * 6)
    assert module.gains_drawn(results).axes[0].lines[0].get_ydata() == pytest.approx([1])


def test_picture_of_page_has_every_colour_of_its_figure_and_one_background():
    figure = new_figure(4, 3)
    axes = figure.subplots()
    for name in BENCHMARKED:
        axes.plot([0, 1], **style_of(name).line())
    text = drawn(figure).decode()
    assert {style_of(name).colour for name in BENCHMARKED} <= set(re.findall("#[0-9a-f]{6}", text))
    ((background,),) = ET.fromstring(text).iterfind(".//*[@class='paper']")
    assert background.attrib["style"] == "fill: #ffffff"
    assert {*re.findall(r"\d+", background.attrib["d"])} == {"0", "288", "216"}


def test_gains_in_libraries_are_ratios_with_paired_intervals(monkeypatch):
    """Equal scatter of two methods on the same chains leaves their ratio without error."""
    module, scatter = page_inputs.benchmark("samplers_in_libraries"), np.array([0.0, 0.1, -0.1])
    found = module.gains({name: 4 - k + (k + 1) * scatter for k, name in enumerate(module.METHODS)})
    assert found["gradients"] == pytest.approx(np.exp(4))
    for k, name in enumerate(module.METHODS[1:], 1):
        half = 12.706 * k * 0.1  # the jackknife of two chains, Student's t with one degree of freedom
        assert np.log(found[name]) == pytest.approx(np.clip([k, k - half, k + half], -9, 9))
