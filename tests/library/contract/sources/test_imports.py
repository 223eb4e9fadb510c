"""Imports: registries as packages, no loops, the library without the workflow, integrations without reductions."""

import ast
import copy
import importlib
import importlib.util
import os
import pickle
import re
import subprocess
import sys
from collections.abc import Mapping
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError, UnknownNameError
from nearharmonic.registry import Registry
from nearharmonic_paper.tasks.experiment import folders
from nearharmonic_paper.tasks.provenance import closure, path_of
from nearharmonic_paper.tasks.reduction import Reductions
from support.projects.extras import names_of, of_extra

# --- the registries are packages and mappings: every import works after any other import ------------------------------


SOURCES = Path(nh.__file__).parents[1]

#: Ways to reach a system, an integrator or the registries, each checked by the assertion behind it.
IMPORTS = {
    "package": (
        "import nearharmonic as nh",
        "assert nh.integrators.nielsen_2015.TABLEAUS and nh.systems.kepler.SYSTEM is nh.systems['kepler']",
    ),
    "system": ("import nearharmonic.systems.kepler as k", "assert k.SYSTEM.V is k.V and k.SYSTEM.grad_V is k.grad_V"),
    "source": (
        "import nearharmonic.integrators.nielsen_2015 as n",
        "assert n.TABLEAUS and nearharmonic.integrators.nielsen_2015.TABLEAUS is n.TABLEAUS",
    ),
    "registries": (
        "from nearharmonic.systems import System, systems; from nearharmonic.integrators import integrators",
        "assert systems.module_of('sho') == 'nearharmonic.systems.sho' and isinstance(systems['sho'], System)\n"
        "assert integrators.module_of('ruth').startswith('nearharmonic.integrators.')",
    ),
    "from package": (
        "from nearharmonic import integrators as i, systems as s",
        "assert 'aba864' in i and 'kepler' in s and s is nearharmonic.systems and i is nearharmonic.integrators",
    ),
}


def in_a_fresh_process(text):
    done = subprocess.run(
        [sys.executable, "-c", text], env={"PYTHONPATH": str(SOURCES)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("first", IMPORTS)
def test_each_import_works_alone_and_before_all_others(first):
    order = [first, *(name for name in IMPORTS if name != first)]
    alone = [IMPORTS[first][0], "import nearharmonic", IMPORTS[first][1]]
    rest = [line for name in order[1:] for line in IMPORTS[name]]
    in_a_fresh_process("\n".join(alone + rest))


@pytest.mark.parametrize(("registry", "one"), [(nh.systems, "kepler"), (nh.integrators, "aba864")])
def test_a_registry_is_a_module_and_a_mapping(registry, one):
    assert isinstance(registry, Mapping)
    assert registry is sys.modules[registry.__name__]
    assert one in registry
    assert "__path__" not in registry
    assert 1 not in registry
    assert list(registry) == list(registry.keys()) == [entry.name for entry in registry.values()]
    assert dict(registry.items())[one] is registry[one] is registry.get(one)
    assert len(registry) == len(set(registry)) > 3
    assert {"items", "keys", "module_of", "__file__", registry.module_of(one).split(".")[-1]} <= set(dir(registry))
    assert one in repr(registry)


def test_registry_is_copied_and_pickled_as_module_that_it_is():
    for registry in (nh.systems, nh.integrators):
        assert copy.deepcopy(registry) is registry
        assert pickle.loads(pickle.dumps(registry)) is registry
        assert {registry: 1}[registry] == 1
    assert nh.systems != nh.integrators


def test_an_unknown_key_or_attribute_is_named():
    with pytest.raises(UnknownNameError, match=r"unknown system 'keppler'\. Did you mean 'kepler'\?"):
        nh.systems["keppler"]
    with pytest.raises(AttributeError, match=r"module 'nearharmonic\.systems' has no attribute 'keppler'"):
        nh.systems.keppler  # noqa: B018
    assert nh.systems.get("keppler") is None


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A package with one entry, and a function that makes it a registry anew."""
    place = tmp_path / "made_up_registry"
    place.mkdir()
    (place / "__init__.py").touch()
    (place / "first.py").write_text("ENTRY = 'one'")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield place
    for name in [name for name in sys.modules if name.startswith(place.name)]:
        del sys.modules[name]


def registry_in(folder):
    __import__(folder.name)
    return Registry(folder.name, "entry", "ENTRY", lambda module: {getattr(module, "ENTRY", "none"): module.__name__})


def test_file_in_folder_is_all_that_entry_takes(folder):
    (folder / "second.py").write_text("ENTRY = 'two'")
    assert dict(registry_in(folder)) == {"one": "made_up_registry.first", "two": "made_up_registry.second"}


def test_a_file_that_declares_nothing_is_not_imported(folder):
    (folder / "second.py").write_text("from made_up_registry.third import ENTRY")
    (folder / "third.py").write_text("if True:\n    ENTRY = 'three'")
    (folder / "tools.py").write_text("raise AssertionError('no ENTRY here')")
    with pytest.raises(NearharmonicError, match="entry 'three' is declared in"):
        len(registry_in(folder))
    (folder / "third.py").unlink()
    (folder / "second.py").unlink()
    assert dict(registry_in(folder)) == {"one": "made_up_registry.first"}


def test_two_files_that_declare_one_name_are_both_named(folder):
    (folder / "second.py").write_text("ENTRY = 'one'")
    with pytest.raises(NearharmonicError, match=r"entry 'one' is declared in \S+\.first and in \S+\.second"):
        len(registry_in(folder))


def test_file_that_would_hide_method_of_mapping_is_refused(folder):
    (folder / "items.py").write_text("ENTRY = 'two'")
    with pytest.raises(NearharmonicError, match="a file must not have the name 'items' of a method"):
        len(registry_in(folder))


def test_the_package_lists_what_it_offers():
    assert set(nh.__all__) <= set(dir(nh))
    assert "kappa" in dir(nh)


def test_top_lists_what_it_offers_and_nothing_that_it_imports():
    assert {name for name in dir(nh) if not name.startswith("__")} == set(nh.__all__) - {"__version__"}


def test_former_name_of_type_is_that_type_and_warns_once():
    vars(nh).pop("ModifiedTableau", None)
    with pytest.warns(DeprecationWarning, match="^nearharmonic.ModifiedTableau is now nearharmonic.Tableau$"):
        assert nh.ModifiedTableau is nh.Tableau
    assert nh.ModifiedTableau is nh.Tableau  # no second warning, which would be an error here
    assert "ModifiedTableau" not in nh.__all__
    del nh.ModifiedTableau


def imported_names(path):
    """Yield (module, name) for each import of the package in a Python file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("nearharmonic"):
            yield from ((node.module, alias.name) for alias in node.names)


def is_there(module, name):
    return hasattr(importlib.import_module(module), name) or importlib.util.find_spec(f"{module}.{name}") is not None


@pytest.mark.parametrize("folder", ["benchmarks", "examples"])
def test_names_that_programs_outside_the_package_import_exist(folder):
    named = {pair for path in (SOURCES.parent / folder).rglob("*.py") for pair in imported_names(path)}
    assert named
    assert not [pair for pair in named if not is_there(*pair)]


# --- modules import one another in one direction ----------------------------------------------------------------------


LIBRARY = Path(nh.__file__).parent


def modules():
    """Paths of all modules by their dotted names."""
    names = {path: ".".join(path.relative_to(SOURCES).with_suffix("").parts) for path in LIBRARY.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for path, name in names.items()}


def imported(tree, names):
    """Modules that a module imports anywhere: at its top, inside of functions, or for types alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in names else node.module


@pytest.mark.slow
def test_no_imports_form_a_loop():
    found = modules()
    del found["nearharmonic"]  # its names are loaded lazily, and it has the version
    graph = {
        name: {one for one in imported(ast.parse(path.read_text()), found) if one in found} - {name}
        for name, path in found.items()
    }
    assert graph["nearharmonic.engine.trajectory"]  # edges are found
    TopologicalSorter(graph).prepare()


# --- independence of the library from the reproduction: README's Python runs without packages of the workflow ---------


ROOT = Path(__file__).parents[4]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "results/paper" not in block]

ABSENT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names} or name.startswith("nearharmonic_paper"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def names(of=None):
    """Modules of extras that these tests hide: of the workflow without modules of figures, or of ``of``."""
    # matplotlib needs contourpy; pillow has another name as a module.
    words = names_of(of_extra(of)) if of else names_of(of_extra("workflow")) - names_of(of_extra("figures"))
    return {"yaml" if word == "pyyaml" else word.replace("-", "_") for word in words} - {"contourpy"}


def run(code, folder, absent=None):
    words = [sys.executable, "-c", ABSENT.format(names=absent or names()) + code]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "agg"}
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, env=environment)


def test_the_packages_of_the_workflow_are_absent_in_these_tests(tmp_path):
    assert {"snakemake", "pydantic", "bokeh", "rocrate", "cma", "yaml"} <= names()
    for name in (*names(), "nearharmonic_paper"):
        assert "No module named" in run(f"import {name}", tmp_path).stderr


@pytest.mark.slow
def test_the_python_of_readme_runs_without_the_workflow(tmp_path):
    """Each block by itself, as printed, in one process."""
    assert BLOCKS
    done = run(
        "".join(f"exec(compile({block!r}, 'block {i}', 'exec'), {{}})\n" for i, block in enumerate(BLOCKS)), tmp_path
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_what_the_library_lacks_is_named_in_a_sentence(tmp_path):
    code = "import nearharmonic as nh; nh.tailor('henon_heiles', window=(0.1, 0.15), trials=50)"
    assert "needs the package cma: pip install 'nearharmonic[tailor]'" in run(code, tmp_path).stderr


@pytest.mark.slow
def test_library_runs_without_matplotlib_and_names_its_extra(tmp_path):
    code = """
import nearharmonic as nh
run = nh.integrate("sho", "babps9o7h", 0.9, t_end=9)
curve = nh.sweep("sho", "babps9o7h", [0.9, 0.45], t_end=9)
assert nh.order_of("babps9o7h") == 4
assert callable(nh.recommend)
nh.plot(curve)
"""
    done = run(code, tmp_path, names("figures"))
    assert done.stderr.splitlines()[-1] == (
        "nearharmonic.errors.MissingPackageError: a plot needs the package matplotlib: "
        "pip install 'nearharmonic[figures]'"
    )


# --- reductions of every experiment are separate from integrations: an edit of a reduction repeats no integration -----


#: Dotted names of all modules that declare reductions, with the folder of each.
MODULES = {
    f"{folder}.{path.stem}": folder
    for folder in folders()
    for path in path_of(folder, SOURCES).parent.glob("*.py")
    if "Reductions()" in path.read_text(encoding="utf-8")
}


def test_the_paper_declares_reductions():
    assert "nearharmonic_paper.experiments.paper.reductions" in MODULES


@pytest.mark.parametrize("module", MODULES)
def test_what_integrates_reaches_no_reduction_and_what_reduces_does(module):
    assert any(isinstance(value, Reductions) for value in vars(import_module(module)).values())
    assert not {name for name in closure(f"{MODULES[module]}.run") if name in MODULES or name.endswith(".reduce")}


@pytest.mark.slow
def test_no_job_that_integrates_loads_xarray():
    """Loading it takes longer than a short run."""
    text = "\n".join(
        [
            "import sys",
            *(f"import {each}.run" for each in sorted({*MODULES.values()})),
            "print('xarray' in sys.modules)",
        ]
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
