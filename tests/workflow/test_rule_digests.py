"""The digest of each rule covers the code that its function reaches: found again by importing it, and by bytecode."""

import json
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from nearharmonic.systems import systems
from nearharmonic_paper.tasks import provenance as sources
from nearharmonic_paper.tasks.experiment import experiments, figures_of
from nearharmonic_paper.tasks.provenance import closure, code_digest

RULES = Path(__file__).parents[2] / "workflow/rules"
ENSEMBLES = ("henon_heiles", "kepler", "rounding")
#: Imports each module by itself and tells what came with it, in one process.
IMPORTER = """
import importlib, json, sys

found = {}
for module in sys.argv[1:]:
    for name in [name for name in sys.modules if name.startswith("nearharmonic")]:
        del sys.modules[name]
    importlib.import_module(module)
    found[module] = [name for name in sys.modules if name.startswith("nearharmonic")]
print(json.dumps(found))
"""


def tasks():
    """The modules of the functions that rules name, and of the figures that they draw."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in RULES.rglob("*.smk"))
    named = re.findall(r'\btask\(\s*f?"([\w.{}]+):[\w.{}]+"', text)
    assert len(named) == len(re.findall(r"\btask\(", text)) - len(re.findall(r"task\(\s*(?:one\.draw|function),", text))
    every = {name.replace("{wildcards.ensemble}", ensemble) for name in named for ensemble in ENSEMBLES}
    cubes = [stem for one in experiments().values() for stem in one.cubes]
    return sorted(every | {one.draw.partition(":")[0] for one in figures_of(systems, cubes)})


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the package whose root imports nothing, so that what comes with a module is what that asks for."""
    root = tmp_path_factory.mktemp("copy")
    for name in sources.PACKAGES:
        shutil.copytree(sources.ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    (root / "nearharmonic/__init__.py").write_text('__version__ = "0"\n')
    return root


@pytest.fixture(scope="module")
def covered(package):
    """Module of a task -> the modules that its digest covers."""
    return {task: set(closure(task, root=package)) for task in tasks()}


@contextmanager
def edited(package, module):
    """One line of code more in a module."""
    path = sources.path_of(module, package)
    text = path.read_bytes()
    path.write_bytes(text + b"\n_EDITED = 1\n")
    yield
    path.write_bytes(text)


@pytest.mark.slow
def test_digest_changes_only_with_modules_that_it_covers(package, covered):
    everything = {*sources.closure(*covered, root=package)}
    for module in everything:
        before = sources.module_digest(module, root=package)
        with edited(package, module):
            assert sources.module_digest(module, root=package) != before, module
    for i, (task, modules) in enumerate(covered.items()):
        inside, outside = sorted(modules), sorted(everything - modules)
        before = code_digest(task, root=package)
        with edited(package, inside[7 * i % len(inside)]):
            assert code_digest(task, root=package) != before, task
        with edited(package, outside[7 * i % len(outside)]):
            assert code_digest(task, root=package) == before, task


def test_there_is_task_for_every_rule_that_runs_script():
    scripts = sum(path.read_text(encoding="utf-8").count("scripts/task.py") for path in RULES.rglob("*.smk"))
    assert scripts >= 18
    assert len(tasks()) >= 20


@pytest.mark.slow
def test_rule_digest_covers_everything_that_comes_with_function(package, covered):
    done = subprocess.run(
        [sys.executable, "-c", IMPORTER, *covered],
        cwd=package.parent,
        env={"PYTHONPATH": str(package.parent), "PATH": "", "HOME": str(package.parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    for task, modules in json.loads(done.stdout).items():
        assert set(modules) - {*sources.PACKAGES} <= covered[task], task


@pytest.mark.slow
def test_comment_or_reworded_docstring_in_any_module_changes_no_digest(package):
    before = {task: code_digest(task, root=package) for task in tasks()}
    for path in package.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        path.write_text("# a comment\n" + re.sub(r'^"""', '"""Reworded: ', text, count=1), encoding="utf-8")
    assert {task: code_digest(task, root=package) for task in before} == before
