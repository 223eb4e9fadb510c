"""Dependencies: each imported package is declared, pinned and locked; only public names of others are used."""

import ast
import re
import sys
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

import nearharmonic
from nearharmonic.adapters import PACKAGES
from support.projects.extras import EXTRAS, names_of, normal, of_extra, of_library

# --- dependencies: each imported package is declared, and pinned for published results --------------------------------


ROOT = Path(__file__).parents[4]
PINNED = {normal(name) for name in re.findall(r"^([\w.-]+)==", (ROOT / "constraints.txt").read_text(), re.MULTILINE)}
#: Libraries that are timed beside ours, and may be missing.
PEERS = ROOT / "src/nearharmonic_paper/experiments/work_precision/peers.py"
#: Modules for one library each, which an extra of the same name installs.
ADAPTERS = ROOT / "src/nearharmonic/adapters"
PLUGINS = {
    "snakemake_executor_plugin_nearharmonic",
    "snakemake_executor_plugin_nearharmonic_forkserver",
    "snakemake_logger_plugin_nearharmonic",
}
OURS = {"nearharmonic", "nearharmonic_paper", "nearharmonic_studies", *PLUGINS}
PYTHON = [*(ROOT / "src").rglob("*.py"), *(ROOT / "workflow").rglob("*.py")]
#: Rules are not Python: they are read line by line.
RULES = [ROOT / "Snakefile", *(ROOT / "workflow").rglob("*.smk")]


@cache
def imported_in(path):
    """Top-level names that a file imports."""
    text = path.read_text(encoding="utf-8")
    if path in RULES:
        return set(re.findall(r"^\s*(?:from|import)\s+(\w+)", text, re.MULTILINE))
    nodes = list(ast.walk(ast.parse(text)))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.level == 0}
    return {name.partition(".")[0] for name in names}


def distributions_of(paths):
    """Distributions that files import, beside the standard library and this package, with the first file of each."""
    known, found = packages_distributions() | {"cuda": ["cuda-bindings"]}, {}  # several share its name
    for path in sorted(paths):
        for name in imported_in(path) - OURS - sys.stdlib_module_names:
            found.setdefault(normal(known.get(name, [name])[0]), str(path.relative_to(ROOT)))
    return found


def in_the_wall(path):
    """True if a file belongs to the library, and is no adapter."""
    return ROOT / "src/nearharmonic" in path.parents and ADAPTERS not in path.parents


@pytest.mark.slow
@pytest.mark.parametrize("name", PACKAGES)
def test_extra_of_an_adapter_installs_what_it_imports(name):
    found = distributions_of(
        path for path in ADAPTERS.rglob("*.py") if path.relative_to(ADAPTERS).parts[0].startswith(name)
    )
    assert {
        one: place
        for one, place in found.items()
        if one not in names_of([*of_library(), *of_extra(name.replace("_", "-"))])
    } == {}


@pytest.mark.slow
def test_every_package_that_the_library_imports_is_a_dependency():
    found = distributions_of(filter(in_the_wall, PYTHON))
    assert {"llvmlite", "xarray"} <= found.keys()
    declared = names_of([*of_library(), *of_extra("figures"), *of_extra("tailor"), *of_extra("gpu")])
    assert {name: place for name, place in found.items() if name not in declared} == {}


def test_only_figures_import_matplotlib():
    places = {path for path in filter(in_the_wall, PYTHON) if "matplotlib" in imported_in(path)}
    assert len(places) > 1
    assert {path for path in places if "plotting" not in path.parts} == set()


@pytest.mark.slow
def test_every_package_that_is_imported_is_declared():
    found = distributions_of(path for path in [*PYTHON, *RULES] if not {PEERS, ADAPTERS} & {path, *path.parents})
    assert {"llvmlite", "pyyaml", "snakemake"} <= found.keys()  # the walk sees Python, other names, and rules
    declared = names_of([*of_library(), *of_extra("workflow"), *of_extra("cluster"), *of_extra("gpu")])
    assert {name: place for name, place in found.items() if name not in declared} == {}


def test_the_page_install_names_every_extra():
    named = re.findall(r"`\[([a-z-]+)\]`", (ROOT / "docs/start/install.md").read_text(encoding="utf-8"))
    assert {*named} == EXTRAS.keys()


@pytest.mark.parametrize("extra", ["workflow", "cluster", "docs", "test"])
def test_extras_of_figures_and_tailor_are_part_of_larger_ones(extra):
    assert names_of([*of_extra("figures"), *of_extra("tailor")]) <= names_of(of_extra(extra))


def test_every_library_that_is_timed_is_declared_with_the_peers():
    declared = names_of([*of_library(), *of_extra("peers")])
    assert distributions_of([PEERS]).keys() <= declared


@pytest.mark.parametrize("extra", EXTRAS)
def test_every_requirement_is_pinned(extra):
    assert names_of([*of_library(), *of_extra(extra)]) - PINNED == set()


@pytest.mark.slow
def test_only_the_store_imports_what_opens_hdf5():
    opening = {path.name for path in PYTHON if imported_in(path) & {"h5py", "h5netcdf"}}
    assert opening == {"store.py"}


# --- locked requirements: the pinned versions, each with digests, and all that the package asks for -------------------


LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
#: Packages of operating systems that constraints.txt was not made on.
ELSEWHERE = {"colorama", "pyreadline3"}


def pins(text):
    """Versions by name in a file of requirements or constraints."""
    found = re.findall(r"^([\w.-]+)==([\w.]+)", text, re.MULTILINE)
    return {canonicalize_name(name): version for name, version in found}


def asked():
    """Requirements of the package, and of the extras that a machine needs for the workflow and its tests."""
    every = (*of_library(), *of_extra("cluster"), *of_extra("test"))
    return list({str(one): one for one in every}.values())


def test_lock_has_versions_of_constraints():
    constraints = pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))
    locked = pins(LOCK)
    assert {name: constraints.get(name) for name in locked.keys() - ELSEWHERE} == {
        name: version for name, version in locked.items() if name not in ELSEWHERE
    }


@pytest.mark.parametrize("requirement", asked(), ids=str)
def test_lock_covers_requirement_of_package(requirement):
    assert requirement.specifier.contains(pins(LOCK)[canonicalize_name(requirement.name)])


def test_each_locked_version_has_digests_and_no_address():
    for block in re.split(r"\n(?=\w)", LOCK)[1:]:
        assert re.search(r"--hash=sha256:[0-9a-f]{64}\b", block), block.splitlines()[0]
    assert "://" not in LOCK


# --- only public names of other libraries are used, which their next version still has --------------------------------


SOURCES = Path(nearharmonic.__file__).parents[1]
LIBRARIES = {"xr", "xarray", "np", "numpy", "pd", "h5py", "h5netcdf", "pydantic", "mpmath"}
#: Private names of methods and attributes of xarray's and h5netcdf's objects that were useful once.
INNER = {"_construct_direct", "_replace_with_new_dims", "_h5group", "_h5file", "_to_temp_dataset"}


def private_uses(text):
    """Names such as ``xr.Dataset._construct_direct`` in a text."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            root = node.value
            while isinstance(root, ast.Attribute):
                root = root.value
            if node.attr in INNER or (isinstance(root, ast.Name) and root.id in LIBRARIES):
                yield ast.unparse(node)


def test_a_private_name_is_recognised():
    text = "import xarray as xr\nxr.Dataset._construct_direct(1)\ngroup._h5group.create_dataset('x')\nself._own\n"
    assert list(private_uses(text)) == ["xr.Dataset._construct_direct", "group._h5group"]


@pytest.mark.slow
def test_no_module_uses_private_parts_of_a_library():
    found = {
        f"{path.relative_to(SOURCES)}: {name}"
        for path in SOURCES.glob("nearharmonic*/**/*.py")
        for name in private_uses(path.read_text(encoding="utf-8"))
    }
    assert not found
