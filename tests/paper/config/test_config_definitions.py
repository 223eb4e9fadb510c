"""Systems and integrators from files in a config or a path: their definitions, and refusals."""

import copy
import json
import os
import pickle
import re
import sys
from decimal import Decimal, localcontext
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.systems.user_file import load_system
from nearharmonic_paper.config import load
from nearharmonic_paper.experiments.paper.run import integrate_run, runs_of
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import defined, digests, read_definitions, settings_text, task
from support.oracles.reference_solutions import oscillator_step
from support.projects.configs_by_file import CONFIG, EXAMPLES, GRID, METHOD, WELL, changed, enter, refused, under


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    return enter(tmp_path, monkeypatch)


def test_system_is_named_by_its_key_in_all_look_ups():
    config = load(CONFIG)
    mine = nh.systems["mine"]
    assert (mine.name, mine.label, mine.q0) == ("mine", "quartic well", ("1", "0"))
    assert [sweep.system for sweep in config.sweeps] == ["mine"]
    assert config.methods == config.decomposed == ("ruth", "five_leapfrogs")
    assert set(config.compared) == {*plain_integrators.registered, "five_leapfrogs"}
    assert nh.sweep("mine", "five_leapfrogs", [0.1]).attrs["system"] == "mine"


def test_config_values_replace_initial_values_and_parameters_of_file():
    load(changed(q0=["3", 0], p0=[0, 1.25], parameters={"b": "0.500000000000000000000000000000000001"}, label="wide"))
    mine = nh.systems["mine"]
    assert (mine.label, mine.q0, mine.p0) == ("wide", ("3", "0"), ("0", "1.25"))
    assert mine.parameters["b"].value == "0.500000000000000000000000000000000001"
    assert mine.parameters["b"].meaning == "strength of the quartic term"
    # H = p.p/2 + q.q/2 + b (q.q)^2/4 with q.q = 9 and p.p = 25/16.
    assert mine.energy(*mine.start(float), mine.constants(float)) == pytest.approx(25 / 32 + 9 / 2 + 81 / 8, rel=1e-15)


@pytest.mark.parametrize(
    ("system", "energy", "squares"),
    [
        ({"system": "sho", "q0": [1], "p0": [-7]}, "0.625", ["-0.25"]),  # 2 E - q^2
        ({"system": "henon_heiles"}, "0.1", ["0", "0.11"]),  # 2 E - 0.3^2
        ({"system": "henon_heiles", "p0": [3, -4]}, "0.17", ["0.09", "-0.16"]),  # 0.25 = 0.09 + 0.16
        ({"system": "relativistic_oscillator", "p0": [3]}, 2.5, ["8"]),  # T = 2 = sqrt(1 + p^2) - 1 at q = 1
        ({"system": "sho", "q0": [1], "p0": [0]}, 0.5, ["0"]),
    ],
)
def test_energy_of_a_config_scales_the_momentum(system, energy, squares):
    load(under("mine", energy=energy, **system))
    with localcontext(prec=50):
        expected = [(Decimal(x).copy_abs().sqrt()).copy_sign(Decimal(x)) for x in squares]
        for found, root in zip(map(Decimal, nh.systems["mine"].p0), expected, strict=True):
            assert abs(found - root) <= abs(root) * Decimal("1e-39")  # 40 digits


def test_a_registered_system_has_other_initial_values_under_another_name():
    load(under("venus", system="kepler", q0=["108.94", "0"], p0=["0", "0.12528"], label="Venus"))
    venus, kepler = nh.systems["venus"], nh.systems["kepler"]
    assert (venus.name, venus.q0, kepler.q0) == ("venus", ("108.94", "0"), ("69.82", "0"))
    assert venus.V is kepler.V
    assert venus.exact_position is kepler.exact_position


def test_a_config_may_have_oscillators_solved_exactly():
    config = load(under("rotated", system="henon_heiles", split="exact_oscillator", t_end=30))
    (sweep,) = config.sweeps
    (run,) = runs_of(sweep, "ruth", 0)
    variables = integrate_run(run)
    alone = nh.integrate("rotated", "ruth", 30 / run.steps[0], t_end=30, split="exact_oscillator", samples=2)
    assert np.array_equal(variables["q"][1][0, run.steps[0]], alone.q.values[-1])
    assert load(under("rotated", system="henon_heiles")).sweeps[0].split == "kinetic_potential"


def test_same_numbers_under_name_of_ones_own_give_same_bits():
    load(under("mercury", system="kepler"))
    for name in ("mercury", "kepler"):
        found = nh.sweep(name, "aba864", [36.0, 72.0], t_end=8766).max_energy_error.values
        assert (
            found.tobytes() == nh.sweep("kepler", "aba864", [36.0, 72.0], t_end=8766).max_energy_error.values.tobytes()
        )


def test_file_is_searched_in_working_directory_then_beside_config(folder):
    (folder / "configs").mkdir()
    place = folder / "configs/mine.yaml"
    place.write_text("name: mine\n")
    (folder / "configs/quartic_well.py").write_text(WELL.replace('"quartic well"', '"beside the config"'))
    load(CONFIG, [place])
    assert nh.systems["mine"].label == "quartic well"
    (folder / "quartic_well.py").unlink()
    load(CONFIG, [place])
    assert nh.systems["mine"].label == "beside the config"
    assert nh.systems.definitions["mine"].file == str(Path("configs/quartic_well.py"))


def test_path_selects_all_integrators_or_one_after_colon():
    again = METHOD.replace("TABLEAU =", "FIRST =") + (
        '\nfrom dataclasses import replace\nTABLEAUS = (FIRST, replace(FIRST, name="second", label="second"))\n'
    )
    Path("two.py").write_text(again)
    assert load(CONFIG | {"integrators": ["two.py"]}).methods == ("five_leapfrogs", "second")
    assert load(CONFIG | {"integrators": ["two.py:second", "ruth"]}).methods == ("second", "ruth")
    own = load(
        CONFIG | {"integrators": ["two.py", "ruth", "aba864"], "decomposition": ["ruth"], "overview": ["aba864"]}
    )
    assert own.decomposed == ("ruth", "five_leapfrogs", "second")
    assert own.compared == ("aba864", "five_leapfrogs", "second")
    assert load(CONFIG | {"integrators": ["ruth"], "decomposition": ["two.py"]}).decomposed == (
        "five_leapfrogs",
        "second",
    )
    assert nh.integrators["two.py:second"].name == "second"
    with refused("two.py defines 2 integrators: name one, as in two.py:five_leapfrogs"):
        nh.integrators["two.py"]
    with refused("unknown integrator of two.py 'secondo'. Did you mean 'second'?"):
        nh.integrators["two.py:secondo"]


def test_a_path_works_wherever_a_name_does():
    run = nh.integrate("quartic_well.py", "fourth_order.py", 0.1, t_end=5)
    assert (run.attrs["system"], run.attrs["integrator"]) == ("quartic_well", "five_leapfrogs")
    assert nh.integrate(Path("quartic_well.py"), Path("fourth_order.py"), 0.1, t_end=5).identical(run)
    assert nh.sweep("quartic_well.py", "fourth_order.py", [0.1], t_end=5).max_energy_error == run.max_energy_error
    assert nh.order_of("fourth_order.py") == 4
    assert len(nh.kappa("fourth_order.py", 4)) == 4
    # |tr K| passes 2 at the limit, and not before.
    method, limit = nh.integrators["fourth_order.py"], nh.stability_limit("fourth_order.py")
    steps = [
        oscillator_step(method, limit * x) for x in (1 + mpf("1e-12"), 1 - mpf("1e-12"), *np.arange(0.01, 1, 0.01))
    ]
    assert [abs(step[0, 0] + step[1, 1]) > 2 for step in steps] == [True] + [False] * (len(steps) - 1)


def test_edited_file_is_read_again_and_unedited_is_same_object(folder):
    before = nh.systems["quartic_well.py"]
    assert nh.systems["quartic_well.py"] is before
    (folder / "quartic_well.py").write_text(WELL.replace("value=0.1", "value=0.25"))
    assert nh.systems["quartic_well.py"].parameters["b"].value == "0.25"
    load(CONFIG)
    assert nh.systems["mine"].parameters["b"].value == "0.25"
    (folder / "quartic_well.py").write_text(WELL.replace("value=0.1", "value=0.5"))
    load(CONFIG)
    assert nh.systems["mine"].parameters["b"].value == "0.5"


def test_file_imports_its_own_neighbouring_modules(folder):
    for name, value in (("one", "0.25"), ("two", "0.75")):
        (folder / name).mkdir()
        (folder / name / "common.py").write_text(f"STRENGTH = '{value}'\n")
        text = WELL.replace("value=0.1", "value=STRENGTH")
        text = text.replace("from near", "from common import STRENGTH\nfrom near", 1)
        (folder / name / "well.py").write_text(text)
    assert [load_system(f"{name}/well.py").parameters["b"].value for name in ("one", "two")] == ["0.25", "0.75"]
    (folder / "one/common.py").write_text("STRENGTH = '0.125'\n")
    assert load_system("one/well.py").parameters["b"].value == "0.125"


@pytest.mark.parametrize("name", ["shared", "shared.numbers"])
def test_run_has_present_text_of_helper_whatever_bytecode_is_kept(folder, monkeypatch, name):
    """Bytecode is kept under the second and the length of its source, which an edit may not change."""
    (folder / "shared").mkdir()
    helper = folder / ("shared/numbers.py" if "." in name else "shared/__init__.py")
    (folder / "well.py").write_text(
        WELL.replace("value=0.1", "value=STRENGTH").replace("from near", f"from {name} import STRENGTH\nfrom near", 1)
    )

    def write(strength):
        helper.write_text(f"STRENGTH = '{strength}'\n")
        os.utime(helper, (1e9, 1e9))

    write("0.25")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    other = import_module(name)  # by another program, and by this one
    assert list(folder.rglob("*.pyc"))
    system = load_system("well.py")
    told, run = pickle.dumps(system), nh.integrate(system, "ruth", 0.1, t_end=2)
    write("0.75")
    assert (load_system("well.py").parameters["b"].value, other.STRENGTH) == ("0.75", "0.25")
    assert sys.modules.pop(name) is other
    sys.modules.pop("shared", None)
    assert copy.copy(system) is copy.deepcopy(system) is system
    assert nh.integrate(copy.deepcopy(system), "ruth", 0.1, t_end=2).identical(run)
    with refused("or a module that it imports, has changed since its SYSTEM was pickled"):
        pickle.loads(told)
    write("0.25")
    assert pickle.loads(told).parameters["b"].value == "0.25"


def code_of(config, system="mine"):
    load(config)
    return digests("nearharmonic_paper.experiments.paper.run:integrate", [system], ["ruth"])["code"]


def test_task_digest_covers_file_and_neighbours_without_comments(folder):
    text = WELL.replace("from near", "from common import SQUARE\nfrom near", 1)
    (folder / "quartic_well.py").write_text(text)
    (folder / "common.py").write_text("SQUARE = 2\n")
    (folder / "other.py").write_text("SQUARE = 2\n")
    first = code_of(CONFIG)
    (folder / "quartic_well.py").write_text(f"# a comment\n{text}")
    (folder / "other.py").write_text("SQUARE = 3\n")
    assert code_of(CONFIG) == first
    (folder / "common.py").write_text("SQUARE = 3\n")
    second = code_of(CONFIG)
    (folder / "quartic_well.py").write_text(text.replace("b * square**2 / 4", "b * square**2 / 8 * 2"))
    assert len({first, second, code_of(CONFIG)}) == 3
    registered = digests("nearharmonic_paper.experiments.paper.run:integrate", ["sho"], ["ruth"])["code"]
    (folder / "common.py").write_text("SQUARE = 4\n")
    load(CONFIG)
    assert digests("nearharmonic_paper.experiments.paper.run:integrate", ["sho"], ["ruth"])["code"] == registered


def test_job_refuses_file_that_has_changed_since_it_was_planned(folder):
    load(CONFIG)
    planned = task("nearharmonic.engine.trajectory:warm_up", system="mine")
    with nh.systems.defining({}), covered(planned):
        assert nh.systems["mine"].label == "quartic well"
        with refused("system 'sho' is looked up, but no digest of the task covers it"):
            nh.systems["sho"]
    assert "mine" in nh.systems
    (folder / "quartic_well.py").write_text(WELL.replace("square**2", "square * square"))
    with refused("quartic_well.py has changed since the run began: start the run again"), covered(planned):
        pass


def test_settings_tell_what_a_config_defines_and_make_it_again():
    load(changed(q0=["3", "0"]))
    warmed = task("nearharmonic.engine.trajectory:warm_up", system="mine", integrator="five_leapfrogs")
    told = json.loads(settings_text(warmed))
    with nh.systems.defining({}), nh.integrators.defining({}), defined(read_definitions(told["definitions"])):
        assert nh.systems["mine"].q0 == ("3", "0")
        assert nh.integrators["five_leapfrogs"].stages == 5


def test_what_a_config_defined_is_forgotten_by_the_next():
    load(CONFIG)
    load({**CONFIG, "integrators": ["ruth"], "systems": {"sho": {"tau_per_stage": GRID}}})
    assert "mine" not in nh.systems
    assert "five_leapfrogs" not in nh.integrators
    load(CONFIG)
    with refused("unknown integrator"):
        load(CONFIG | {"integrators": ["rut"]})
    assert "mine" in nh.systems  # from the last config that was sound


def test_the_shipped_example_is_sound():
    import yaml

    place = EXAMPLES / "wells.yaml"
    config = load(yaml.safe_load(place.read_text(encoding="utf-8")), [place])
    assert config.methods == ("ruth", "babps9o7h", "five_leapfrogs")
    assert list(config.systems) == ["quartic_well", "wide_orbit", "long_pendulum", "venus"]
    assert re.match(r"mpf|2\.|3\.", repr(float(nh.stability_limit("five_leapfrogs"))))


# --- Systems and integrators from files in a config or a path: invalid definitions and their errors.


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
        (WELL.replace("(1, 0)", '("nan", 0)'), "systems.mine: quartic_well: q0[0] = 'nan' is not a finite decimal"),
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
        "q0": ["1", "0"], "p0": ["0", "1"], "parameters": {"GM": "1"}, "energy": "0.1", "file": "quartic_well.py",
        "split": "exact_oscillator",
    }.get(key, "kepler")  # fmt: skip
    source = {"file": "file: quartic_well.py", "system": "system: kepler"}.get(key, f"system: kepler, {key}: ...")
    remedy = f"taken as it is: write it under another name, as own_kepler: {{{source}, tau_per_stage: ...}}"
    with refused(f"systems.kepler.{key} = {value!r} is not allowed: kepler is a registered system, {remedy}"):
        load(under("kepler", **{key: value}))


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
