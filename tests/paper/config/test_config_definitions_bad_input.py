"""Systems and integrators from files in a config or a path: invalid definitions and their errors."""

from __future__ import annotations

import pytest

import nearharmonic as nh
from nearharmonic_paper.config import load
from nearharmonic_paper.tasks.experiment import experiments
from support.projects.configs_by_file import CONFIG, METHOD, WELL, changed, enter, refused, under


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    return enter(tmp_path, monkeypatch)


@pytest.mark.parametrize(
    ("system", "says"),
    [
        ({"file": None}, "unknown system 'mine'"),
        ({"file": 3}, "systems.mine.file = 3 is not allowed: the path of a Python file"),
        ({"q0": [1]}, "systems.mine: q0 has 1 components, and quartic well has 2"),
        ({"q0": [10**5000, 0]}, "systems.mine.q0[0] = a number of type int"),
        ({"parameters": {"c": 1}}, "systems.mine: unknown parameter of quartic well 'c'"),
        ({"parameters": {3: "1"}}, "a key of systems.mine.parameters = 3"),
        # That is told before the key that is missing.
        ({"tau_per_stage": None, "tau_per_stag": 1}, "systems.mine 'tau_per_stag'. Did you mean 'tau_per_stage'?"),
        ({"split": "exact_oscillator"}, "is not allowed: mine declares no freq"),
    ],
)
def test_a_system_that_is_none_is_refused_in_one_sentence(system, says):
    with refused(says):
        load(changed(**system))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("x = 1\n", "systems.mine: quartic_well.py does not define SYSTEM, a nearharmonic.System"),
        ("SYSTEM = 3\n", "does not define SYSTEM, a nearharmonic.System: its SYSTEM is of type int"),
        (WELL.replace("SYSTEM", "system"), "a nearharmonic.System; did you mean its 'system'?"),
        ("1 / 0\n", "systems.mine: quartic_well.py cannot be run: ZeroDivisionError: division by zero"),
        ("def", "systems.mine: quartic_well.py cannot be run: SyntaxError"),
        (WELL.replace('"1", "0"', '"nan", "0"'), "systems.mine: quartic_well: q0[0] = 'nan' is not a finite decimal"),
        (WELL.replace("V=V,", "V=V, grad_V=lambda q, b: q,"), "systems.mine: mine: grad_V"),
        (WELL.replace("return x * v - y * u", "return z"), "the invariant angular_momentum cannot be evaluated"),
    ],
)
def test_file_without_valid_system_is_refused_before_any_job(folder, content, says):
    (folder / "quartic_well.py").write_text(content)
    with refused(says):
        load(CONFIG)


@pytest.mark.parametrize("key", ["file", "system", "label", "q0", "p0", "energy", "parameters", "split"])
def test_registered_system_is_unchanged_under_its_own_name(key):
    value = {
        "q0": ["1", "0"],
        "p0": ["0", "1"],
        "parameters": {"GM": "1"},
        "energy": "0.1",
        "file": "quartic_well.py",
        "split": "exact_oscillator",
    }.get(key, "kepler")
    source = {"file": "file: quartic_well.py", "system": "system: kepler"}.get(key, f"system: kepler, {key}: ...")
    remedy = f"taken as it is: write it under another name, as own_kepler: {{{source}, tau_per_stage: ...}}"
    with refused(f"systems.kepler.{key} = {value!r} is not allowed: kepler is a registered system, {remedy}"):
        load(under("kepler", **{key: value}))


@pytest.mark.parametrize("key", [3, None, True])
def test_a_key_that_is_no_text_is_refused(key):
    with refused(f"a key of systems = {key}"):
        load(under(key, file="quartic_well.py"))


@pytest.mark.parametrize("key", ["two words", "q-0", "1st", "class", "größe", "a" * 61])
def test_a_name_that_is_no_identifier_is_refused(key):
    with refused(f"systems.{key} = {key!r} is not allowed: a letter, then letters, digits and '_'"):
        load(under(key, file="quartic_well.py"))


#: Names of the cubes and of the folders of runs that experiments declare.
CUBES = sorted(stem for one in experiments().values() for stem in one.cubes)
FOLDERS = ("exact_oscillator", "stability", "trained")


@pytest.mark.parametrize("key", [*CUBES, *FOLDERS, "substeps", "sweeps", "items", "sort"])
def test_name_that_workflow_has_another_use_for_is_refused(key):
    with refused(f"systems.{key} = {key!r} is not allowed: the workflow uses this name itself"):
        load(under(key, file="quartic_well.py"))


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        (["nowhere.py"], "integrators[0] = 'nowhere.py' is not allowed: no such file in "),
        (["quartic_well.py"], "integrators[0]: quartic_well.py does not define TABLEAU, a nearharmonic.Tableau"),
        (
            ["fourth_order.py:five"],
            "integrators[0] = 'fourth_order.py:five' is not allowed: fourth_order.py defines five_l",
        ),
        (["fourth_order.py", "fourth_order.py:five_leapfrogs"], "each integrator named once"),
        (
            ["fourth_order.py", "copy.py"],
            "integrators[1] = 'copy.py' is not allowed: fourth_order.py defines the integrator",
        ),
        (
            ["hides.py"],
            "integrators[0]: hides.py: the integrator 'ruth' is a registered one already; give it another name",
        ),
        (["spaced.py"], "integrators[0] = 'five leapfrogs' is not allowed: a letter, then letters"),
        (["plural.py"], "did you mean its 'TABLEAUX'"),
        (["small.py"], "did you mean its 'tableau'"),
        (
            ["wrong.py"],
            "integrators[0]: tableau 'five_leapfrogs': order = 0, expected an integer from 1 to 10, twice the stages",
        ),
    ],
)
def test_file_that_defines_no_integrator_of_its_own_is_refused(folder, entries, says):
    (folder / "copy.py").write_text(METHOD)
    (folder / "hides.py").write_text(METHOD.replace('"five_leapfrogs"', '"ruth"'))
    (folder / "spaced.py").write_text(METHOD.replace('"five_leapfrogs"', '"five leapfrogs"'))
    (folder / "plural.py").write_text(METHOD.replace("TABLEAU =", "TABLEAUX ="))
    (folder / "small.py").write_text(METHOD.replace("TABLEAU =", "tableau ="))
    (folder / "wrong.py").write_text(METHOD.replace("order=4", "order=0"))
    with refused(says):
        load(CONFIG | {"integrators": entries})


def test_path_with_registered_system_name_needs_name_in_config(folder):
    (folder / "quartic_well.py").write_text(WELL.replace('name="quartic_well"', 'name="kepler"'))
    with refused("quartic_well.py: SYSTEM has the name of the registered system 'kepler'; give it another name"):
        nh.integrate("quartic_well.py", "ruth", 0.1)
    load(CONFIG)
    assert nh.systems["mine"].name == "mine"


@pytest.mark.parametrize("path", ["nowhere.py", "folder/well"])
def test_a_path_that_is_no_file_is_refused(path):
    with refused(f"{path}: no such file. A system of your own is a Python file that defines SYSTEM"):
        nh.sweep(path, "ruth", [0.1])
    with refused(f"{path}: no such file. An integrator of your own is a Python file that defines TABLEAU"):
        nh.sweep("sho", path, [0.1])
