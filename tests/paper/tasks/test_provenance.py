"""Digests see the code that a result depends on, all of it and nothing else."""

from __future__ import annotations

import ast
import atexit
import itertools
import shutil
from dataclasses import dataclass, replace

import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators, modified_integrators
from nearharmonic.systems import systems
from nearharmonic_paper.tasks import provenance
from nearharmonic_paper.tasks import provenance as sources
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import closure, code_digest, coefficients_digest, library_version, task


@pytest.fixture
def package(tmp_path):
    """A copy of the packages, to be edited."""
    for name in sources.PACKAGES:
        shutil.copytree(sources.ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def edited(package, module, line="_EDITED = 1"):
    """``package`` with one line more at the end of ``module``."""
    with (package / module).open("a", encoding="utf-8") as file:
        file.write(f"{line}\n")
    return package


def tree_digest(text):
    return sources.parsed(text.encode()).digest


def digests(root):
    of_runs = {
        name: code_digest("nearharmonic_paper.experiments.paper.run", systems.module_of(name), root=root)
        for name in systems
    }
    folder = "nearharmonic_paper.experiments.paper"
    return {
        **of_runs,
        "cubes": code_digest(f"{folder}.reductions", root=root),
        "fig1": code_digest("nearharmonic.plotting.style", root=root),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "changes"),
    [
        ("nearharmonic/systems/kepler.py", {"kepler", "kepler_regularised"}),
        pytest.param(
            "nearharmonic/systems/relativistic_oscillator.py", {"relativistic_oscillator"}, marks=pytest.mark.slow
        ),
        ("nearharmonic/core/kernel.py", {*systems, "cubes"}),  # reductions take logarithms, which are compiled
        pytest.param(
            "nearharmonic/integrators/nielsen_2015.py", set(), marks=pytest.mark.slow
        ),  # coefficients have a digest of their own
        ("nearharmonic_paper/experiments/paper/reductions.py", {"cubes"}),
        pytest.param("nearharmonic/plotting/style.py", {"fig1"}, marks=pytest.mark.slow),
        pytest.param("nearharmonic_paper/experiments/paper/figures.py", set(), marks=pytest.mark.slow),
        pytest.param("nearharmonic/cli.py", set(), marks=pytest.mark.slow),
        pytest.param("nearharmonic/__init__.py", set(), marks=pytest.mark.slow),
    ],
)
def test_edit_changes_only_digests_of_dependents(package, module, changes):
    before = digests(package)
    after = digests(edited(package, module))
    assert {name for name in before if before[name] != after[name]} == changes


def test_a_comment_or_a_docstring_is_no_edit(package):
    before = digests(package)
    path = package / "nearharmonic/core/kernel.py"
    text = path.read_text(encoding="utf-8")
    assert '"""' in text
    path.write_text("# a comment\n" + text.replace('"""', '"""Reworded. ', 1) + "\n# and another\n", encoding="utf-8")
    for docstring in ("class Added:", "def added():"):
        first, second = (f'{docstring}\n    """{words}"""\n    x = 1\n' for words in ("One.", "Another, longer."))
        assert len({sources.parsed(text.encode()).digest for text in (first, second)}) == 1
    assert digests(package) == before


def test_a_string_that_is_no_docstring_is_code(package):
    names = ["x = 'a'\n", "x = 'b'\n", "def f():\n    x = 1\n    'a'\n", "def f():\n    x = 1\n    'b'\n"]
    assert len({sources.parsed(text.encode()).digest for text in names}) == 4


def test_texts_have_the_same_digest_exactly_if_the_library_prints_the_same_tree():
    texts = "1|1.0|True|'1'|b'1'|1j|...|None|x|'x'|x.a|x .a|Name|f(x)|f(x,)|f(*x)|f(x=x)|[x]|(x)|(x,)|{x}|{**x}|x[0]"
    texts += "|x[0:]|x+y|x - y|x-y|x<y<z|not x|x: int|(x): int|x = y|x += y|assert x|lambda a: a|lambda *, a: a"
    texts += (
        "|f'{x}'|f'{x!r}'|[x for x in y]|global x|import a|import a as b|lambda a: a|from . import a|from .. import a"
    )
    codes = [f"pass\n{text}" for text in texts.split("|")]
    printed = {code: ast.dump(ast.parse(code)) for code in codes}
    pairs = [*itertools.combinations(codes, 2)]
    same = [pair for pair in pairs if len({*map(tree_digest, pair)}) == 1]
    assert same == [pair for pair in pairs if len({printed[code] for code in pair}) == 1] != []


@pytest.mark.slow
def test_the_same_code_has_the_same_digest_wherever_it_lies(package):
    assert digests(package) == digests(sources.ROOT)


def test_function_imports_count_and_type_checking_imports_do_not(tmp_path):
    root = tmp_path / "nearharmonic"
    (root / "part").mkdir(parents=True)
    for name, text in {
        "__init__": "import nearharmonic.never",
        "a": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from nearharmonic import c\n"
        "def f():\n    import nearharmonic.b\n",
        "b": "import json\nimport nearharmonic.part.leaf",
        "c": "",
        "part/__init__": "from . import sibling\nnumber = 1",
        "part/leaf": "from ..d import something",
        "part/sibling": "",
        "d": "from nearharmonic import a, b",
    }.items():
        (root / f"{name}.py").write_text(text)
    found = {module.removeprefix("nearharmonic.") for module in closure("nearharmonic.a", root=tmp_path)}
    assert found == {"a", "b", "d", "part", "part.leaf", "part.sibling"}


def test_a_module_that_is_not_there_is_named():
    with pytest.raises(NearharmonicError, match=r"no module 'nearharmonic\.nowhere'"):
        code_digest("nearharmonic.nowhere")


@pytest.mark.parametrize("library", ["numpy", "numba", "llvmlite"])
def test_a_new_version_of_a_numerical_library_changes_every_digest(library, monkeypatch):
    before = code_digest("nearharmonic.errors")
    own = library_version
    monkeypatch.setattr(provenance, "library_version", lambda name: "0.0" if name == library else own(name))
    assert code_digest("nearharmonic.errors") != before


def test_coefficient_digest_distinguishes_methods_and_labels_but_not_remarks():
    ruth, yoshida = integrators["ruth"], integrators["yoshida_s7o6a"]
    others = ([ruth], [yoshida], [ruth, yoshida], [ruth.role("kick")], [replace(ruth, label="R")])
    assert len({coefficients_digest(tableaus) for tableaus in others}) == 5
    assert coefficients_digest([replace(ruth, note="reworded", source="elsewhere")]) == coefficients_digest([ruth])


@pytest.mark.parametrize("row", ["kick", "drift"])
def test_coefficient_digest_covers_each_row(row):
    rows = {"kick": ("0.4", "0.6"), "drift": ("0.4", "0.6", "0")}
    plain = replace(integrators["leapfrog"], first="drift", symmetric=False, **rows)
    changed = replace(plain, **{row: ("0.25", "0.75", *rows[row][2:])})
    assert coefficients_digest([plain]) != coefficients_digest([changed])


def test_coefficient_digest_does_not_depend_on_earlier_computations():
    rowlands = integrators["rowlands"]
    before = coefficients_digest([rowlands])
    assert rowlands.kernel.processor is None
    assert len(rowlands.compositions) == 3
    assert coefficients_digest([rowlands]) == before == coefficients_digest([replace(rowlands)])
    assert coefficients_digest([rowlands.kernel]) != before


@dataclass(frozen=True)
class Asked:
    system: str
    taus: tuple[float, ...]


WARM_UP = "nearharmonic.engine.trajectory:warm_up"


def test_task_covers_systems_and_methods_named_at_any_depth():
    plain = task(WARM_UP, system="nothing")
    assert task(WARM_UP, asked=Asked("nothing", (1.0,)))["code"] == plain["code"]
    for settings in (
        {"system": "kepler"},
        {"asked": Asked("kepler", (1.0,))},
        {"asked": {"kepler": 5}},
        {"a": [["kepler"]]},
    ):
        assert task(WARM_UP, **settings)["code"] == task(WARM_UP, system="kepler")["code"] != plain["code"]
    assert task(WARM_UP, methods=("ruth",))["coefficients"] == coefficients_digest([integrators["ruth"]])


def test_task_looks_up_only_what_it_names_or_imports():
    with covered(task(WARM_UP, system="sho", methods=["ruth"])):
        assert systems["sho"].name == "sho"
        assert integrators["ruth"].stages == 3
        assert "kepler" in systems
        for registry, name in ((systems, "kepler"), (integrators, "aba864")):
            with pytest.raises(NearharmonicError, match=f"'{name}' is looked up"):
                registry[name]
    assert systems["kepler"].name == "kepler"
    # Figure 6 imports the modules of what it shows.
    with covered(task("nearharmonic_paper.experiments.paper.figures:fig6_substeps")):
        assert systems["henon_heiles"].name == "henon_heiles"
        assert integrators["babs7o7h"].stages == 7


def test_task_covers_modified_methods_that_it_names():
    one = task("nearharmonic_paper.experiments.paper.tableaus:decompose", integrators=["chin_4a", "ruth"])
    assert one["integrators"] == ["chin_4a", "ruth"]
    assert one["coefficients"] == coefficients_digest([modified_integrators["chin_4a"], integrators["ruth"]])
    with covered(one):
        assert modified_integrators["chin_4a"].stages == 2
        with pytest.raises(NearharmonicError, match="'omelyan_g5o6' is looked up, but no digest"):
            modified_integrators["omelyan_g5o6"]


def test_a_result_says_where_it_comes_from_without_a_clock():
    origin = provenance.provenance(
        {"settings": {"b": 2, "a": Asked("sho", (0.5,))}, "code": "c0de", "coefficients": "c0ef"}
    )
    assert origin["settings"] == '{"a": {"system": "sho", "taus": [0.5]}, "b": 2}'
    assert set(origin) == {
        "package_version", "code_digest", "settings", "coefficients_digest",
        "numpy_version", "numba_version", "llvmlite_version", "h5py_version",
    }  # fmt: skip
    assert (origin["code_digest"], origin["coefficients_digest"]) == ("c0de", "c0ef")


# --- Parsed sources are looked up by their text, in this process and in the next.

TEXT = b'"""A docstring."""\nimport nearharmonic.errors\nx = 1\n'


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """A new memory each time it is called, with one place on disk; it is not written when the tests end."""
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(atexit, "register", lambda function: None)
    return sources.SourceCache


def test_the_next_process_parses_nothing_that_this_one_has_parsed(memory, monkeypatch):
    first = memory()
    found = first.parsed(TEXT)
    assert found == sources.parsed(TEXT)
    first.keep()
    monkeypatch.setattr(sources, "parsed", lambda text: pytest.fail("parsed again"))
    assert memory().parsed(TEXT) == found


def test_an_edited_text_is_another_text(memory):
    first = memory()
    first.parsed(TEXT)
    first.keep()
    edited = TEXT.replace(b"x = 1", b"x = 2")
    assert memory().parsed(edited) == sources.parsed(edited)
    assert sources.parsed(edited).digest != sources.parsed(TEXT).digest


def test_a_memory_that_is_damaged_is_forgotten(memory, tmp_path):
    first = memory()
    first.parsed(TEXT)
    first.keep()
    (place,) = tmp_path.iterdir()
    content = bytearray(place.read_bytes())
    content[-5] ^= 1
    place.write_bytes(content)
    assert memory().parsed(TEXT) == sources.parsed(TEXT)
    assert not place.exists()
