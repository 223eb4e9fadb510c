"""Reference and developers' pages: lists, generated pages, the map and the version agree with the code."""

import contextlib
import inspect
import io
import json
import re
import tomllib

import numpy as np
import pytest
import yaml

import nearharmonic as nh
from nearharmonic import cli
from nearharmonic.cli import main
from support.results.stated_numbers import ROOT

# --- lists of docs/reference: signatures, commands, statuses, dimensions and variables agree with the code ------------


NAMES = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs/reference/command_line.md").read_text(encoding="utf-8")
#: Defaults that are written out.
PLAIN = (str, int, float, tuple, type(None))
DATASETS = {
    "integrate": lambda: nh.integrate("sho", "ruth", 0.3, t_end=3),
    "sweep": lambda: nh.sweep("sho", "ruth", [0.3, 0.2], t_end=3),
    "ensemble": lambda: nh.ensemble("sho", "ruth", 0.3, t_end=3, q0=[[1], [2]]),
    "tangent": lambda: nh.tangent("sho", "ruth", 0.3, t_end=3, q0=[[1], [2]]),
    "gradient": lambda: nh.gradient(
        "kepler", "ruth", 10, "angular_momentum", t_end=30, q0=[[80, 0], [90, 0]], coefficients=True
    ),
    "recommend": lambda: nh.recommend("sho", 1e-2, methods=["ruth"], t_end=10),
}


def signature(name):
    """Arguments of a function with their defaults, "..." for a default that is an object."""
    words, marked = [], False
    for one in inspect.signature(getattr(nh, name)).parameters.values():
        if one.kind is one.KEYWORD_ONLY and not marked:
            marked = True
            if not words or not words[-1].startswith("*"):
                words.append("*")
        default = "" if one.default is one.empty else "=" + (repr(one.default) if type(one.default) in
            {*PLAIN, bool} else "...")  # fmt: skip
        words.append(("*" if one.kind is one.VAR_POSITIONAL else "") + one.name + default)
    return f"{name}({', '.join(words)})"


def callables():
    return {name for name in nh.__all__ if inspect.isfunction(getattr(nh, name)) or isinstance(getattr(nh, name), type)}


def rows(page, head, columns):
    """Cells of the table with this word at the head of its first column."""
    (table,) = re.findall(rf"^\| {head} \|.*\n(?:\|.*\n)+", page, re.MULTILINE)
    return [[cell.strip() for cell in line.strip("|").split("|")][:columns] for line in table.splitlines()[2:]]


def words_in(cell):
    return set(re.findall(r"`([\w.]+)`", cell))


def test_signatures_are_those_of_the_functions():
    (block,) = re.findall(r"```text\n(.*?)```", NAMES, re.DOTALL)
    listed = re.sub(r"\n    \s*", " ", block).splitlines()
    expected = {signature(name) for name in callables() - {"NearharmonicError"}}
    assert set(listed) == expected
    assert len(listed) == len(expected)


def test_commands_are_those_of_the_page():
    (sentence,) = re.findall(r"The commands are (.*?)\. Each", COMMANDS, re.DOTALL)
    assert re.findall(r"`([\w-]+)`", sentence) == list(cli.command_names())


@pytest.mark.slow
def test_exit_statuses_are_those_of_the_page(capsys):
    damaged = ROOT / "tests/library/exchange/tableaus/damaged/claim.toml"
    found = [cli.main(words) for words in (["list"], ["verify-tableau", str(damaged)], ["lists"])]
    assert [int(status) for status, _ in rows(COMMANDS, "exit status", 2)] == [*found, cli.INTERRUPTED]
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_environment_variables_of_page_are_read_somewhere():
    named = set(re.findall(r"NEARHARMONIC_\w+", COMMANDS))
    assert len(named) > 1
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    assert {name for name in named if f'"{name}"' not in sources} == set()


@pytest.mark.parametrize("name", DATASETS)
def test_datasets_have_dimensions_and_variables_of_page(name):
    table = {next(iter(words_in(function))): cells for function, *cells in rows(NAMES, "function", 3)}
    assert set(table) == {f"nh.{one}" for one in DATASETS}
    dimensions, variables = (words_in(cell) for cell in table[f"nh.{name}"])
    if variables == {"nh.integrate"}:
        variables = words_in(table["nh.integrate"][1])
    found = DATASETS[name]()
    assert {name for name in found.sizes if not str(name).endswith("_component")} == dimensions
    assert variables <= set(found.variables)


# --- generated pages of docs/reference: methods, systems and commands as the library has them, and every public name --


REFERENCE = ROOT / "docs/reference"
#: Methods of each kind: of two and more stages, of Nystrom type, asymmetric, with a gradient, processed, our own.
EXAMPLES = ("leapfrog", "ruth", "srkn_b11", "ruth_s3o3", "chin_4a", "rowlands", "trained_light", "sofspa_s35o10")
#: Methods whose source is no publication that paper.bib has: their entries have the text of the source.
WITHOUT_AUTHORS = {"na7", "rnia12", "nystrom_6a8"}

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


@pytest.mark.slow
def test_every_method_has_a_page_and_a_linked_row(pages):
    from generated_reference import link_methods

    assert {f"integrators/{name}.md" for name in nh.integrators} == pages.keys()
    source = [(REFERENCE / "methods.md").read_text(encoding="utf-8")]
    link_methods(None, "reference/methods", source)
    assert {*re.findall(r"^\| \[`\w+`\]\(generated/(\S+)\) \|", source[0], re.MULTILINE)} == pages.keys()


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_example_of_a_page_prints_what_it_says(pages, name):
    page = pages[f"integrators/{name}.md"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(blocks(page, "python")[1], {})
    assert re.findall(r"It prints `(.*?)`", page) == [out.getvalue().strip()]


@pytest.mark.slow
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


@pytest.mark.slow
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


# --- pages for developers and the changelog: they are short, name tests that exist, and have one version everywhere ---


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FOLDER = ROOT / "docs/developers"
CITED = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_drawing_has_the_layers_of_the_import_contracts():
    drawn = re.findall(r'<tspan class="room">(\w+)<', (FOLDER / "layers.svg").read_text(encoding="utf-8"))
    contracts = {one["name"]: one for one in PROJECT["tool"]["importlinter"]["contracts"]}
    layers = [layer for of in ("paper", "library") for layer in contracts[f"rooms of the {of} are in layers"]["layers"]]
    assert drawn == [room.strip() for layer in layers for room in layer.split("|")]


def test_the_map_of_the_house_names_what_exists():
    (listing,) = re.findall(r"```\n(.*?)```", (FOLDER / "house.md").read_text(encoding="utf-8"), re.DOTALL)
    folder = ROOT
    for line in listing.splitlines():
        names = re.findall(r"[\w./]+(?:/|\.py)(?=[\s,]|$)", line)
        if not line.startswith(" ") and names:
            folder = ROOT / names[0]
        assert [name for name in names if not (folder / name).exists() and not (ROOT / name).exists()] == []


def test_newest_release_is_the_version_of_package_and_citation():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    version, day = re.findall(r"^## \[(\d\S*)\] - (\S+)$", text, re.MULTILINE)[0]
    assert (version, day) == (CITED["version"], CITED["date-released"].isoformat())
    assert version == nh.__version__
