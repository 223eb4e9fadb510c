"""A fresh generation from small inputs fills each marked part of a page and leaves its text."""

from __future__ import annotations

import json
import re
from itertools import cycle
from pathlib import Path
from runpy import run_path

import pytest
from PIL import Image

from nearharmonic.output import store
from nearharmonic.output.dataset import variable
from nearharmonic.recommendation.measure import variables
from nearharmonic_paper.pages import examples, gallery, methods, ranking, trained, training
from nearharmonic_paper.pages.anharmonicity import NEW, Result, others
from nearharmonic_paper.pages.how_to import gauss, tabulated, tailor, tangent_maps
from nearharmonic_paper.pages.how_to import variables as of_variables
from nearharmonic_paper.pages.targets import (
    crystals,
    derivation,
    exact_oscillator,
    regularised,
    samplers,
    stability,
    timings,
)
from nearharmonic_paper.report.shown.pictures import few_colours
from support.cubes.figure_cubes import FACTS, label, timed
from support.results.tables_of_targets import CELLS, LINES, TABLES, TRAINED, filled_by, write_crossings, write_samplers

pytestmark = pytest.mark.slow

ON_CRYSTALS = ("leapfrog", "babps9o7h", "trained_light", "trained_on_crystals")
DOCS = Path(__file__).parents[3] / "docs"
PAGES = {path.stem: path for path in DOCS.glob("*/*.md") if "<!-- end -->" in path.read_text(encoding="utf-8")}
MARKED = sorted(PAGES)


def text_of(name):
    return PAGES[name].read_text(encoding="utf-8")


def split(text):
    """The text of a page outside its marks, and its parts by name."""
    pattern = r"(?<=<!-- )(?!end )([\w-]+)( -->\n)(.*?)(?=\n<!-- end -->)"
    parts = {name: part for name, _, part in re.findall(pattern, text, flags=re.DOTALL)}
    return re.sub(pattern, r"\1\2", text, flags=re.DOTALL), parts


def of_examples(monkeypatch, tmp_path):
    """All errors of the new methods are a tenth of the others', of which two are alike."""
    errors = dict.fromkeys(others(), 1e-4) | dict.fromkeys(NEW, 1e-5)
    deltas = cycle((1e-3, 0.05, 0.3, 0.9))
    monkeypatch.setattr(
        examples,
        "measured",
        lambda orbit: Result(orbit=orbit, delta=next(deltas), omega=1, errors=dict.fromkeys((25, 50, 100), errors)),
    )
    files = [str(path) for path in DOCS.parent.glob("examples/*.py")]
    return examples.page(str(PAGES["examples"]), files, (), ())


def of_files(monkeypatch, tmp_path):
    places = [tmp_path / f"{name}.h5" for name in ("sho", "kepler")]
    for place, unit in zip(places, ("1", "h"), strict=True):
        store.write(place, {"t": variable("sample", [0.0, 1.0], "time", unit)}, {})
    return of_variables.page(str(PAGES["files"]), places, places, (), ())


def of_all_variables(monkeypatch, tmp_path):
    place = tmp_path / "added.h5"
    store.write(place, {"x": variable("point", [1.0], "a|b_c")}, {})
    return of_variables.reference(str(PAGES["variables"]), [place], ["runs/{name}.h5"])


def of_gallery(monkeypatch, tmp_path):
    """The first two examples, which are not run."""
    monkeypatch.setattr(gallery, "drawn", len)
    files = sorted(str(path) for path in DOCS.parent.glob("examples/*.py"))[:2]
    return gallery.page(str(PAGES["gallery"]), files, (), ())


def of_ranking(monkeypatch, tmp_path):
    monkeypatch.setattr(ranking, "table", lambda contest: ["| error |", "|---|", f"| {contest.t_end} |"])
    return ranking.page(str(PAGES["ranking"]), (), ())


def of_gauss(monkeypatch, tmp_path):
    for name, few in {"AMPLITUDES": (0.1,), "TIMES": (4, 8, 16), "ORBITS": 2}.items():
        monkeypatch.setattr(gauss, name, few)
    return gauss.page(str(PAGES["gauss"]), (), ())


def of_tabulated_potentials(monkeypatch, tmp_path):
    """Errors that are powers of the step size."""
    found = {
        method: {form: tabulated.STEPS**power for power, form in enumerate(tabulated.LOOKS, 3)}
        for method in tabulated.METHODS
    }
    monkeypatch.setattr(tabulated, "errors", lambda: found)
    monkeypatch.setattr(tabulated, "DEGREES", (3, 5))
    return tabulated.page(str(PAGES["tabulated_potentials"]), (), ())


def of_tangent_maps(monkeypatch, tmp_path):
    """Few starts and a short time."""
    monkeypatch.setattr(tangent_maps, "SIZE", 12)
    monkeypatch.setattr(tangent_maps, "T_END", 100)
    return tangent_maps.page(str(PAGES["tangent_maps"]), (), ())


def of_tailor(monkeypatch, tmp_path):
    for name in ("example", "elsewhere"):
        monkeypatch.setattr(tailor, name, lambda name=name: name)
    for name in ("over_fitting", "gains"):
        monkeypatch.setattr(tailor, name, lambda subjects, name=name: f"{name} of {len(subjects)}")
    files = [str(path) for path in DOCS.parent.glob("examples/*.py")]
    return tailor.page(str(PAGES["tailor"]), files, (), ())


def of_timings(monkeypatch, tmp_path):
    path, errors = tmp_path / "times.h5", [1e-3, 1e-6, 1e-9, 1e-12]
    found = [timed("ruth", errors, [1e-5, 2e-5, 4e-5, 9e-5], lanes=[1e-6] * 4),
             timed("heyoka", errors, [5e-5] * 4, kind="peer", lanes=[4e-6] * 4)]  # fmt: skip
    problems = {name: {"system": name, "t_end": "20", "measures": ["max"]} for name in timings.SYSTEMS}
    facts = {**FACTS, "libraries": "heyoka 7", "problems": json.dumps(problems)}
    store.write(path, {}, facts, groups=dict.fromkeys(problems, variables(found, "s")))
    text = timings.page(str(PAGES["timings"]), str(path), (), ())["page"]
    return {"page": filled_by(["beyond_double", "kernels"], text, monkeypatch, tmp_path)}


def of_regularised(monkeypatch, tmp_path):
    """Regularised equations take a tenth of the time of the original ones."""
    path, errors, groups = tmp_path / "times.h5", [1e-6, 1e-9, 1e-12], {}
    for name, factor in (("kepler", 1), ("kepler_regularised", 0.1)):
        found = [timed("babps9o7h", errors, [factor * time for time in (2e-5, 4e-5, 8e-5)])]
        found += [timed("heyoka", errors[:2], [1e-5] * 2, kind="peer")] * (factor == 1)
        groups[name] = variables(found, "h")
    problems = {name: {"system": name, "t_end": "20", "measures": ["max", "position"]} for name in groups}
    store.write(path, {}, {**FACTS, "libraries": "heyoka 7", "problems": json.dumps(problems)}, groups=groups)
    return regularised.page(str(PAGES["regularised"]), str(path), list(groups), (), ())


def of_trained(monkeypatch, tmp_path):
    for name, text in TRAINED.items():
        (tmp_path / f"trained_{name}.csv").write_text(text)
    return trained.page(str(PAGES["trained"]), [*map(str, tmp_path.glob("*.csv"))], ())


def of_training(monkeypatch, tmp_path):
    path = tmp_path / "light.csv"
    path.write_text(
        "composition,stages,squares,searches,methods tried,ended at the best,best from,least gain,mean gain\n"
        "BAB,6,,21,90340,13,refined,-0.281,0.43\n"
    )
    return training.page(str(PAGES["training"]), (), light=str(path))


def of_tables(module, name):
    """Function that makes a page of the tables of a target."""

    def made(monkeypatch, tmp_path):
        for stem, text in TABLES[name].items():
            (tmp_path / f"{stem}.csv").write_text(text)
        return module.page(str(PAGES[name]), [*map(str, tmp_path.glob("*.csv"))], ())

    return made


def of_benchmarks(name, *commands):
    """Function that makes a page of the numbers of commands below benchmarks/."""
    return lambda monkeypatch, tmp_path: {"page": filled_by(commands, text_of(name), monkeypatch, tmp_path)}


def of_exact_oscillator(monkeypatch, tmp_path):
    path = tmp_path / "cube.h5"
    write_crossings(path)
    return exact_oscillator.page(str(PAGES["exact_oscillator"]), str(path), (), ())


def of_crystals(monkeypatch, tmp_path):
    place = "reproduction/experiments/crystals/example_cubes.py"
    cube = run_path(str(Path(__file__).parents[2] / place))["crystals"](ON_CRYSTALS)
    monkeypatch.setattr(crystals, "read", {"cube": cube}.get)
    return crystals.page(str(PAGES["crystals"]), "cube", (), ())


def of_samplers(monkeypatch, tmp_path):
    path = tmp_path / "samplers.h5"
    write_samplers(path)
    text = samplers.page(str(PAGES["samplers"]), str(path), (), ())["page"]
    return {"page": filled_by(["samplers_in_libraries"], text, monkeypatch, tmp_path)}


def of_methods(monkeypatch, tmp_path):
    monkeypatch.setattr(methods, "parts", lambda: dict.fromkeys(("methods", "modified", "implicit", "errors"), "| a |"))
    return methods.page(str(PAGES["methods"]), (), ())


MADE = {
    "crystals": of_crystals, "derivation": of_tables(derivation, "derivation"),
    "stability": of_tables(stability, "stability"),
    "exact_oscillator": of_exact_oscillator, "examples": of_examples, "files": of_files, "gallery": of_gallery,
    "methods": of_methods, "ranking": of_ranking, "regularised": of_regularised, "samplers": of_samplers,
    "tailor": of_tailor, "tangent_maps": of_tangent_maps, "gauss": of_gauss,
    "tabulated_potentials": of_tabulated_potentials, "timings": of_timings, "trained": of_trained,
    "training": of_training, "variables": of_all_variables, "stepper": of_benchmarks("stepper", "stepper"),
    "formulas": of_benchmarks("formulas", "functions"), "large_grids": of_benchmarks("large_grids", "large_grids"),
    "larger_systems": of_benchmarks("larger_systems", "larger_systems"),
    "trials": of_benchmarks("trials", "trials --quick", "trials"),
}  # fmt: skip


@pytest.fixture(scope="module")
def made(request, tmp_path_factory):
    """Results of the function of a page, for reading alone."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        return MADE[request.param](monkeypatch, tmp_path_factory.mktemp("made"))


def test_there_is_a_generator_of_every_page_with_marks():
    assert sorted(MADE) == MARKED


@pytest.mark.parametrize(("made", "name"), [(name, name) for name in MARKED], indirect=["made"])
def test_all_parts_are_filled_and_the_text_stays(made, name):
    text, parts = split(made["page"])
    before, old = split(text_of(name))
    if name == "ranking":  # whose text names the machine
        text, before = (re.sub(r"Machine: .*? Times", "", one, flags=re.DOTALL) for one in (text, before))
    assert text == before
    assert parts.keys() == old.keys()
    if name != "training":
        assert all(parts[part] != old[part] for part in parts if part != "attributes")
    assert all(part.strip() for part in parts.values())


@pytest.mark.parametrize("made", ["trained"], indirect=True)
def test_tables_of_trained_methods_show_the_numbers_of_the_results(made):
    _, parts = split(made["page"])
    assert {part for part, cell in CELLS.items() if cell in parts[part]} == set(parts)


@pytest.mark.parametrize(("made", "lines"), LINES.items(), indirect=["made"])
def test_parts_of_targets_show_the_numbers_of_their_tables(made, lines):
    _, parts = split(made["page"])
    assert {part for part, line in lines.items() if line in parts[part].splitlines()} == set(parts)


@pytest.mark.parametrize("made", ["training"], indirect=True)
def test_the_landscape_shows_the_numbers_of_the_searches(made):
    _, parts = split(made["page"])
    assert "| low accuracy | BAB | 6 | 21 | 90340 | 13 | refined | −0.28 | 0.43 |" in parts["landscape"]


@pytest.mark.parametrize("made", ["timings"], indirect=True)
def test_tables_of_times_have_milliseconds_and_ratios_to_the_shortest(made):
    _, parts = split(made["page"])
    assert parts["ratios"].count("\n") == 7
    assert "each of an ensemble | 0.25 | 0.25 | 0.25 |" in parts["ratios"]
    assert "one trajectory | 0.4 | 0.8 | **1.8** |" in parts["ratios"]
    assert "### simple harmonic oscillator, t = 20\n\n| one trajectory | 10⁻³ | 10⁻⁶ | 10⁻⁹ | 10⁻¹² |" in parts["times"]
    assert f"| {label('ruth')} | **0.01** | **0.02** | **0.04** | 0.09 (1.8) |" in parts["times"]


@pytest.mark.parametrize("made", ["regularised"], indirect=True)
def test_tables_of_regularised_times_have_ratios_to_the_original_equations(made):
    _, parts = split(made["page"])
    energy, position = parts["times"].split("\n\n")
    assert "| e = 0.206, energy | 10⁻⁶ | 10⁻⁹ | 10⁻¹² |" in energy
    assert "| fastest method here, regularised | 0.002 (0.2) | 0.004 (0.4) | 0.008 |" in energy
    assert "| heyoka (adaptive Taylor), original equations | 0.01 (1) | 0.01 (1) | not reached |" in energy
    assert position.startswith("| e = 0.206, position |")


@pytest.mark.parametrize("made", ["files"], indirect=True)
def test_units_that_differ_are_those_of_the_system(made):
    _, parts = split(made["page"])
    assert parts["runs"] == parts["cube"]
    assert "| `t` | sample | unit of t | time |" in parts["runs"]


@pytest.mark.parametrize("made", ["variables"], indirect=True)
def test_texts_of_files_do_not_end_cells(made):
    _, parts = split(made["page"])
    assert "## `runs/{name}.h5`" in parts["variables"]
    assert r"| `x` | point | 1 | a\|b\_c |" in parts["variables"]


@pytest.mark.parametrize("made", ["examples"], indirect=True)
def test_gains_on_examples_are_ratios_of_the_smallest_errors(made):
    _, parts = split(made["page"])
    assert parts["bands"].count("+1.0 / **+1.0** / +1.0") == 4 * 2 * 3
    assert made["figure"].axes[0].lines[0].get_ydata() == pytest.approx([1])


@pytest.mark.parametrize(("size", "expected"), [((2200, 500), (1100, 250)), ((99, 50), (99, 50))])
def test_picture_of_page_is_narrow_with_few_colours_on_white(tmp_path, size, expected):
    place = tmp_path / "figure.png"
    figure = Image.new("RGB", size, "white")
    figure.paste(Image.effect_noise((size[0], size[1] - 30), 90).convert("RGB"))
    figure.save(place)
    place.write_bytes(few_colours(str(place), 20)["picture"])
    with Image.open(place) as picture:
        assert (picture.format, picture.size) == ("PNG", expected)
        assert len(picture.getcolors()) <= 20
        low = picture.convert("RGB").crop((0, expected[1] - 10, *expected))
        assert [colour for _, colour in low.getcolors()] == [(255, 255, 255)]
