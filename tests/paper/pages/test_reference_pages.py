"""Generated pages of docs/reference: methods, systems and commands as the library has them, and every public name."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.cli import command_names, main
from support.results.stated_numbers import ROOT

pytestmark = pytest.mark.slow

REFERENCE = ROOT / "docs/reference"
#: Methods of each kind: of two and more stages, of Nystrom type, asymmetric, with a gradient, processed, our own.
EXAMPLES = ("leapfrog", "ruth", "srkn_b11", "ruth_s3o3", "chin_4a", "rowlands", "trained_light", "sofspa_s35o10")
#: Methods whose source is no publication that paper.bib has: their entries have the text of the source.
WITHOUT_AUTHORS = {"na7", "rnia12", "nystrom_6a8"}
#: Values of the variables in the formulas of the systems, for a state of each dimension.
STATES = {1: ((0.7,), (-0.4,)), 2: ((0.3, -0.5), (0.6, 0.2))}

each_method = pytest.mark.parametrize("name", [name for name, one in nh.integrators.items() if not one.implicit])


@pytest.fixture(scope="module")
def extensions():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs/_extensions"))
        yield


@pytest.fixture(scope="module")
def pages(extensions):
    from generated_reference import pages

    return pages()


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)


def cells(page):
    """Cells of the rows of all tables, by the first one."""
    rows = [re.split(r" (?<!\\)\| ", row) for row in re.findall(r"^\| (.*) \|$", page, flags=re.MULTILINE)]
    return {first: rest for first, *rest in rows}


def printed(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([*words]) == 0
    return out.getvalue()


def test_every_method_has_a_page_and_a_row(pages):
    assert {f"integrators/{name}.md" for name in nh.integrators} == pages.keys() - {"parts/integrators.md"}
    linked = re.findall(r"\(generated/(integrators/\w+\.md)\)", pages["parts/integrators.md"])
    assert linked == [f"integrators/{name}.md" for name in nh.integrators]


@each_method
def test_page_has_the_exported_digits_and_the_proved_orders(pages, name):
    page, one = pages[f"integrators/{name}.md"], nh.integrators[name]
    rows = {}
    exec(blocks(page, "python")[0], rows)
    assert [rows["first"], rows["kick"], rows["drift"]] == [one.first, one.kick, one.drift]
    if one.modified:
        assert rows["square"] == one.square
    else:
        exported = json.loads(printed("export", name, "--to", "json"))
        assert [list(rows["kick"]), list(rows["drift"])] == [exported["kick"], exported["drift"]]
    facts = cells(page)
    assert facts["harmonic order"] == [str(nh.harmonic_order(name))]
    assert one.modified or facts["order"] == [str(nh.order_of(name))]
    assert one.requires is None or facts["order for quadratic T"] == [str(one.order)]
    assert facts["stages s"] == [str(one.stages)]


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_of_a_page_prints_what_it_says(pages, name):
    page = pages[f"integrators/{name}.md"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(blocks(page, "python")[1], {})
    assert re.findall(r"It prints `(.*?)`", page) == [out.getvalue().strip()]


@pytest.mark.parametrize("name", [*nh.implicit_integrators])
def test_page_of_an_implicit_method_has_nodes_and_weights(pages, name):
    page, one, rows = pages[f"integrators/{name}.md"], nh.integrators[name], {}
    exec(blocks(page, "python")[0], rows)
    nodes, weights = np.polynomial.legendre.leggauss(one.stages)
    half = (one.stages + 1) // 2
    # The nodes of numpy are exact to about an ulp.
    assert np.abs(np.array(rows["c"], float) - (1 + nodes[:half]) / 2).max() < 1e-15
    assert np.abs(np.array(rows["b"], float) - weights[:half] / 2).max() < 1e-15
    assert all(len(digits) >= 40 for digits in (*rows["c"], *rows["b"]))
    assert f"| order | {one.order} |" in page
    assert "τ = ∞" in page


@each_method
def test_bibtex_of_a_page_names_the_source(pages, name):
    (text,) = blocks(pages[f"integrators/{name}.md"], "bibtex")
    source = nh.integrators[name].source
    entries = text.strip().split("\n\n")
    assert all(re.match(r"@\w+\{\w+,\n", entry) and entry.count("{") == entry.count("}") for entry in entries)
    identifiers = re.findall(r"(?:doi:|arXiv:)([^\s,;]+)", source)
    assert all(one in text for one in identifiers)
    assert all("  author = " in entry for entry in entries) == (name not in WITHOUT_AUTHORS)
    assert text.startswith("@software") == source.startswith(("found by", "trained by"))
    (year,) = re.findall(r"\((\d{4})\)", source)[:1] or [""]
    assert year in text


def value_of(formula, system):
    """H of a formula as the page has it, in LaTeX, at a state of the system."""
    q, p = STATES[system.dimension]
    text = re.sub(r"\\sqrt\{(.*?)\}", r"(\1)^0.5", formula).replace("\\lvert q\\rvert", "r")
    text = text.replace("p_x", "px").replace("p_y", "py").replace("^", "**")
    text = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text)
    names = dict(zip(("x", "y"), q, strict=False)) | dict(zip(("px", "py"), p, strict=False))
    norms = {key: sum(c * c for c in row) ** 0.5 for key, row in (("r", q), ("q", q), ("p", p))}
    constants = {key: float(one.value) for key, one in system.parameters.items()}
    return eval(text, {"__builtins__": {}}, {**norms, **names, **constants})


@pytest.mark.parametrize("name", [*nh.systems])
def test_section_of_a_system_has_its_formula_and_numbers(extensions, name):
    from generated_reference import systems_part

    part = systems_part()
    sections = {re.findall(r"^\| name \| `(\w+)` \|$", one, re.MULTILINE)[0]: one for one in part.split("\n## ")}
    assert sections.keys() == {*nh.systems}
    system, section = nh.systems[name], sections[name]
    q, p = STATES[system.dimension]
    (formula,) = re.findall(r"\$\$H = (.*?)\$\$", section)
    assert value_of(formula, system) == pytest.approx(system.energy(q, p, system.constants(float)), rel=1e-14)
    facts = cells(section)
    assert facts["q at t = 0"] == [f"({', '.join(system.q0)})"]
    assert facts["end of the interval"] == [f"t = {system.t_end}"]
    assert all(facts[f"`{key}`"][:2] == [one.value, one.unit] for key, one in system.parameters.items())


def test_help_texts_are_those_that_a_terminal_shows(extensions, monkeypatch):
    from generated_reference import COLUMNS, commands_part

    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    shown = dict(re.findall(r"^## (.*?)\n\n```text\n(.*?)\n```", commands_part(), flags=re.MULTILINE | re.DOTALL))
    assert shown.keys() == {"nearharmonic", *(f"nearharmonic {name}" for name in command_names())}
    for heading, text in shown.items():
        assert text == printed(*heading.split()[1:], "--help").rstrip()


def test_page_of_python_lists_every_public_name():
    text = (REFERENCE / "api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^   (\w+)$", text, flags=re.MULTILINE)
    assert len(listed) == len(set(listed))
    named = re.findall(r"`(?:nh\.)?(__version__)`", text)
    assert {*listed, *named} == {*nh.__all__, "math"}


def test_writer_leaves_unchanged_pages_and_removes_old_ones(extensions, tmp_path):
    from generated_reference import write_all

    write_all(tmp_path, {"methods/a.md": "a", "methods/b.md": "b"})
    os.utime(tmp_path / "methods/a.md", (1, 1))
    write_all(tmp_path, {"methods/a.md": "a", "methods/c.md": "c"})
    assert (tmp_path / "methods/a.md").stat().st_mtime == 1
    assert {path.name for path in tmp_path.glob("*/*")} == {"a.md", "c.md"}
