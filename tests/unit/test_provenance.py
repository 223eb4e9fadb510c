"""Digests see the code that a result depends on, all of it and nothing else."""

from __future__ import annotations

import json
import shutil
from hashlib import sha256
from pathlib import Path

import pytest

from nearharmonic import provenance
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.provenance import closure, code_digest, coefficients_digest, write_manifest
from nearharmonic.systems import systems


@pytest.fixture
def package(tmp_path):
    """A copy of the package, to be edited; each test has its own folder, so nothing that is cached goes stale."""
    root = tmp_path / "nearharmonic"
    shutil.copytree(provenance.ROOT, root, ignore=shutil.ignore_patterns("__pycache__"))
    return root


def edited(package, tmp_path, module):
    """A second copy, with one comment more at the end of ``module``."""
    root = tmp_path / "edited" / "nearharmonic"
    shutil.copytree(package, root)
    with (root / module).open("a", encoding="utf-8") as file:
        file.write("# edited\n")
    return root


def digests(root):
    layers = ("nearharmonic.integrate", "nearharmonic.store")
    of_runs = {name: code_digest(*layers, systems.module_of(name), root=root) for name in systems}
    cubes = code_digest("nearharmonic.reduce", "nearharmonic.store", root=root)
    return {**of_runs, "cubes": cubes, "fig1": code_digest("nearharmonic.render.fig1_sho", root=root)}


@pytest.mark.parametrize(
    ("module", "changes"),
    [
        ("systems/kepler.py", {"kepler"}),
        ("systems/sho.py", {"sho"}),
        ("core/kernel.py", set(systems)),
        ("integrators/nielsen_2015.py", set()),  # coefficients have a digest of their own
        ("reduce.py", {"cubes"}),
        ("render/style.py", {"fig1"}),
        ("render/fig2_decomposition.py", set()),
        ("store.py", {*systems, "cubes"}),
        ("config.py", set()),
        ("provenance.py", set()),
        ("__init__.py", set()),
    ],
)
def test_an_edit_changes_the_digests_of_what_depends_on_it_and_no_other(package, tmp_path, module, changes):
    before, after = digests(package), digests(edited(package, tmp_path, module))
    assert {name for name in before if before[name] != after[name]} == changes


def test_the_same_code_has_the_same_digest_wherever_it_lies(package):
    assert digests(package) == digests(provenance.ROOT)


def test_imports_inside_functions_count_and_those_for_the_type_checker_do_not(tmp_path):
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
    found = {module.removeprefix("nearharmonic.") for module in closure("nearharmonic.a", root=root)}
    assert found == {"a", "b", "d", "part", "part.leaf", "part.sibling"}


def test_a_module_that_is_not_there_is_named():
    with pytest.raises(NearharmonicError, match=r"no module 'nearharmonic\.nowhere'"):
        code_digest("nearharmonic.nowhere")


def test_what_is_digested_beside_the_code_changes_the_digest():
    assert code_digest("nearharmonic.errors") != code_digest("nearharmonic.errors", also=["abc"])


def test_coefficients_have_a_digest_that_tells_methods_apart():
    ruth, yoshida = integrators["ruth"], integrators["yoshida_s7o6a"]
    assert len({coefficients_digest(names) for names in ([ruth], [yoshida], [ruth, yoshida], [ruth.role("kick")])}) == 4


def test_a_result_says_where_it_comes_from_without_a_clock():
    origin = provenance.provenance({"b": 2, "a": 1}, code="c0de", coefficients="c0ef")
    assert origin["settings"] == '{"a": 1, "b": 2}'
    assert set(origin) == {
        "package_version", "code_digest", "settings", "coefficients_digest",
        "numpy_version", "numba_version", "h5py_version",
    }  # fmt: skip
    assert origin == provenance.provenance({"a": 1, "b": 2}, code="c0de", coefficients="c0ef")


def test_the_manifest_holds_the_digest_of_every_output(tmp_path):
    (tmp_path / "cubes").mkdir()
    (tmp_path / "cubes" / "sho.h5").write_bytes(b"numbers")
    write_manifest(tmp_path / "manifest.json", [tmp_path / "cubes" / "sho.h5"])
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["sha256"] == {str(Path("cubes/sho.h5")): sha256(b"numbers").hexdigest()}
    assert {"finished", "host", "versions"} <= set(manifest)
