"""Systems and integrators that a config, or a path, names by file: what they are, and which are refused."""

from __future__ import annotations

import copy
import json
import re
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.config import load
from nearharmonic.errors import NearharmonicError
from nearharmonic.output.definitions import defined, read_definitions
from nearharmonic.output.job import covered
from nearharmonic.output.provenance import digests, settings_text, task
from nearharmonic.systems.user_file import load_system

EXAMPLES = Path(__file__).parents[1] / "examples"
GRID = {"lowest": 0.05, "highest": 0.5, "points_per_decade": 4}
WELL = (EXAMPLES / "quartic_well.py").read_text(encoding="utf-8")
METHOD = (EXAMPLES / "fourth_order.py").read_text(encoding="utf-8")
CONFIG = {
    "name": "mine",
    "integrators": ["ruth", "fourth_order.py"],
    "systems": {"mine": {"file": "quartic_well.py", "tau_per_stage": GRID}},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working directory with both examples; what configs define is forgotten after the test."""
    (tmp_path / "quartic_well.py").write_text(WELL)
    (tmp_path / "fourth_order.py").write_text(METHOD)
    monkeypatch.chdir(tmp_path)
    with nh.systems.defining({}), nh.integrators.defining({}):
        yield tmp_path


def changed(**system):
    """CONFIG with other keys of its system, None to take one away."""
    config = copy.deepcopy(CONFIG)
    config["systems"]["mine"] = {k: v for k, v in (config["systems"]["mine"] | system).items() if v is not None}
    return config


def under(key, **system):
    return CONFIG | {"systems": {key: {"tau_per_stage": GRID, **system}}}


@contextmanager
def refused(says):
    with pytest.raises(NearharmonicError) as caught:
        yield
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_system_has_the_name_of_its_key_wherever_it_is_looked_up():
    config = load(CONFIG)
    mine = nh.systems["mine"]
    assert (mine.name, mine.label, mine.q0) == ("mine", "quartic well", ("1", "0"))
    assert [sweep.system for sweep in config.sweeps] == ["mine"]
    assert config.methods == config.decomposed == ("ruth", "five_leapfrogs")
    assert set(config.compared) == {*nh.integrators.registered, "five_leapfrogs"}
    assert nh.sweep("mine", "five_leapfrogs", [0.1]).attrs["system"] == "mine"


def test_initial_values_and_parameters_of_the_config_take_the_place_of_the_files_own():
    load(changed(q0=["3", 0], p0=[0, 1.25], parameters={"b": "0.50000000000000000000000001"}, label="wide"))
    mine = nh.systems["mine"]
    assert (mine.label, mine.q0, mine.p0) == ("wide", ("3", "0"), ("0", "1.25"))
    assert mine.parameters["b"].value == "0.50000000000000000000000001"
    assert mine.parameters["b"].meaning == "strength of the quartic term"
    # H = p.p/2 + q.q/2 + b (q.q)^2/4 with q.q = 9 and p.p = 25/16.
    assert mine.energy(*mine.start(float), mine.constants(float)) == pytest.approx(25 / 32 + 9 / 2 + 81 / 8, rel=1e-15)


def test_a_registered_system_has_other_initial_values_under_another_name():
    load(under("venus", system="kepler", q0=["108.94", "0"], p0=["0", "0.12528"], label="Venus"))
    venus, kepler = nh.systems["venus"], nh.systems["kepler"]
    assert (venus.name, venus.q0, kepler.q0) == ("venus", ("108.94", "0"), ("69.82", "0"))
    assert venus.V is kepler.V
    assert venus.exact_position is kepler.exact_position


def test_the_same_numbers_under_a_name_of_ones_own_give_the_same_bits():
    load(under("mercury", system="kepler"))
    for name in ("mercury", "kepler"):
        found = nh.sweep(name, "aba864", [36.0, 72.0], t_end=8766).max_energy_error.values
        assert (
            found.tobytes() == nh.sweep("kepler", "aba864", [36.0, 72.0], t_end=8766).max_energy_error.values.tobytes()
        )


def test_a_file_is_looked_for_from_the_working_directory_and_then_beside_the_config(folder):
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


def test_a_path_stands_for_all_integrators_of_its_file_and_for_one_behind_a_colon():
    again = METHOD.replace("TABLEAU =", "FIRST =") + (
        '\nfrom dataclasses import replace\nTABLEAUS = (FIRST, replace(FIRST, name="second", label="second"))\n'
    )
    Path("two.py").write_text(again)
    assert load(CONFIG | {"integrators": ["two.py"]}).methods == ("five_leapfrogs", "second")
    assert load(CONFIG | {"integrators": ["two.py:second", "ruth"]}).methods == ("second", "ruth")
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
    # 1 - tau^2/2 + ... of five leapfrogs, |tr K| = 2: found again by bisection of the product of the five.
    assert float(nh.stability_limit("fourth_order.py")) == pytest.approx(limit_of_five_leapfrogs(), rel=1e-12)


def limit_of_five_leapfrogs():
    u = 1 / (4 - 4 ** (1 / 3))

    def trace(tau):
        step = np.eye(2)
        for part in (u, u, 1 - 4 * u, u, u):
            drift, kick = np.array([[1, part * tau / 2], [0, 1]]), np.array([[1, 0], [-part * tau, 1]])
            step = drift @ kick @ drift @ step
        return abs(np.trace(step))

    taus = np.linspace(0.01, 6, 60000)
    first = next(i for i, tau in enumerate(taus) if trace(tau) > 2 + 1e-9)
    low, high = taus[first - 1], taus[first]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if trace(middle) <= 2 else (low, middle)
    return low


def test_an_edited_file_is_read_again_and_one_that_is_not_is_the_same_object(folder):
    before = nh.systems["quartic_well.py"]
    assert nh.systems["quartic_well.py"] is before
    (folder / "quartic_well.py").write_text(WELL.replace('value="0.1"', 'value="0.25"'))
    assert nh.systems["quartic_well.py"].parameters["b"].value == "0.25"
    load(CONFIG)
    assert nh.systems["mine"].parameters["b"].value == "0.25"
    (folder / "quartic_well.py").write_text(WELL.replace('value="0.1"', 'value="0.5"'))
    load(CONFIG)
    assert nh.systems["mine"].parameters["b"].value == "0.5"


def test_a_file_may_import_from_the_files_beside_it_which_are_its_own(folder):
    for name, value in (("one", "0.25"), ("two", "0.75")):
        (folder / name).mkdir()
        (folder / name / "common.py").write_text(f"STRENGTH = '{value}'\n")
        text = WELL.replace('value="0.1"', "value=STRENGTH").replace(
            "from near", "from common import STRENGTH\nfrom near", 1
        )
        (folder / name / "well.py").write_text(text)
    assert [load_system(f"{name}/well.py").parameters["b"].value for name in ("one", "two")] == ["0.25", "0.75"]
    (folder / "one/common.py").write_text("STRENGTH = '0.125'\n")
    assert load_system("one/well.py").parameters["b"].value == "0.125"


def code_of(config, system="mine"):
    load(config)
    return digests("experiments.paper.run:integrate", [system], ["ruth"])["code"]


def test_the_digest_of_a_task_covers_the_file_and_those_beside_it_and_no_comment(folder):
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
    registered = digests("experiments.paper.run:integrate", ["sho"], ["ruth"])["code"]
    (folder / "common.py").write_text("SQUARE = 4\n")
    load(CONFIG)
    assert digests("experiments.paper.run:integrate", ["sho"], ["ruth"])["code"] == registered


def test_a_job_refuses_a_file_that_has_changed_since_it_was_planned(folder):
    load(CONFIG)
    planned = task("engine.trajectory:warm_up", system="mine")
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
    told = json.loads(settings_text(task("engine.trajectory:warm_up", system="mine", integrator="five_leapfrogs")))
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
    assert "mine" in nh.systems  # that of the last config that was sound


@pytest.mark.parametrize(
    ("system", "says"),
    [
        ({"file": "quartic.py"}, "systems.mine.file = 'quartic.py' is not allowed: no such file in "),
        ({"file": None}, "unknown system 'mine'"),
        (
            {"file": None, "q0": [1]},
            "systems.mine lacks file, the Python file that defines it, or system, a registered",
        ),
        ({"system": "kepler"}, "systems.mine.system = 'kepler' is not allowed: file is given as well"),
        ({"file": None, "system": "keplr"}, "systems.mine.system: unknown system 'keplr'. Did you mean 'kepler'?"),
        ({"file": 3}, "systems.mine.file = 3 is not allowed: the path of a Python file"),
        ({"q0": [1]}, "systems.mine: q0 has 1 components, and quartic well has 2"),
        ({"p0": [1, 0, 0]}, "systems.mine: p0 has 3 components, and quartic well has 2"),
        ({"q0": 1}, "systems.mine.q0 = 1 is not allowed: a list of numbers, as many as the system has coordinates"),
        ({"q0": []}, "systems.mine.q0 = [] is not allowed"),
        ({"q0": [1, "one"]}, "systems.mine.q0[1] = 'one' is not allowed: a finite number, or a decimal string"),
        ({"q0": [1, float("nan")]}, "systems.mine.q0[1] = nan is not allowed"),
        ({"q0": ["1e400", 0]}, "systems.mine.q0[0] = '1e400' is not allowed"),
        ({"q0": [1, True]}, "systems.mine.q0[1] = True is not allowed"),
        ({"p0": [float("inf"), 0]}, "systems.mine.p0[0] = inf is not allowed"),
        ({"parameters": {"c": 1}}, "systems.mine: unknown parameter of quartic well 'c'"),
        ({"parameters": {"b": "nan"}}, "systems.mine.parameters.b = 'nan' is not allowed: a finite number"),
        ({"parameters": {"b": None}}, "systems.mine.parameters.b = None is not allowed"),
        ({"parameters": [1]}, "systems.mine.parameters = [1] is not allowed: a mapping of names of parameters"),
        ({"fil": "x.py"}, "unknown key of systems.mine 'fil'. Did you mean 'file'?"),
        ({"label": ""}, "systems.mine.label = '' is not allowed"),
    ],
)
def test_a_system_that_is_none_is_refused_in_one_sentence(system, says):
    with refused(says):
        load(changed(**system))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("x = 1\n", "systems.mine: quartic_well.py does not define SYSTEM, a nearharmonic.System"),
        ("1 / 0\n", "systems.mine: quartic_well.py cannot be run: ZeroDivisionError: division by zero"),
        ("def", "systems.mine: quartic_well.py cannot be run: SyntaxError"),
        (WELL.replace('"1", "0"', '"nan", "0"'), "systems.mine: quartic_well: q0[0] = 'nan' is not a finite decimal"),
        (WELL.replace("V=V,", "V=V, grad_V=lambda q, b: q,"), "systems.mine: mine: grad_V"),
        (WELL.replace("return x * v - y * u", "return z"), "the invariant angular_momentum cannot be evaluated"),
    ],
)
def test_a_file_that_defines_no_sound_system_is_refused_before_any_job(folder, content, says):
    (folder / "quartic_well.py").write_text(content)
    with refused(says):
        load(CONFIG)


@pytest.mark.parametrize("key", ["file", "system", "label", "q0", "p0", "parameters"])
def test_a_registered_system_is_taken_as_it_is_under_its_own_name(key):
    value = {"q0": ["1", "0"], "p0": ["0", "1"], "parameters": {"GM": "1"}, "file": "quartic_well.py"}.get(
        key, "kepler"
    )
    with refused(f"systems.kepler.{key} = {value!r} is not allowed: kepler is a registered system, taken as it is"):
        load(under("kepler", **{key: value}))


@pytest.mark.parametrize("key", ["two words", "q-0", "1st", "class", "größe", "a" * 61])
def test_a_name_that_is_no_identifier_is_refused(key):
    with refused(f"systems.{key} = {key!r} is not allowed: a letter, then letters, digits and '_'"):
        load(under(key, file="quartic_well.py"))


@pytest.mark.parametrize("key", ["substeps", "sho_terms", "structure", "stability_kepler", "sweeps", "items", "sort"])
def test_a_name_that_the_workflow_has_another_use_for_is_refused(key):
    with refused(f"systems.{key} = {key!r} is not allowed: the workflow has another use of this name"):
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
        (["wrong.py"], "integrators[0]: tableau 'five_leapfrogs': order = 0, expected an integer >= 1"),
    ],
)
def test_a_file_that_defines_no_integrator_of_its_own_is_refused(folder, entries, says):
    (folder / "copy.py").write_text(METHOD)
    (folder / "hides.py").write_text(METHOD.replace('"five_leapfrogs"', '"ruth"'))
    (folder / "spaced.py").write_text(METHOD.replace('"five_leapfrogs"', '"five leapfrogs"'))
    (folder / "wrong.py").write_text(METHOD.replace("order=4", "order=0"))
    with refused(says):
        load(CONFIG | {"integrators": entries})


def test_a_path_whose_system_has_a_registered_name_is_refused_and_a_config_gives_it_another(folder):
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


def test_the_shipped_example_is_sound():
    import yaml

    place = EXAMPLES / "wells.yaml"
    config = load(yaml.safe_load(place.read_text(encoding="utf-8")), [place])
    assert config.methods == ("ruth", "babps9o7h", "five_leapfrogs")
    assert list(config.systems) == ["quartic_well", "wide_orbit", "long_pendulum", "venus"]
    assert re.match(r"mpf|2\.|3\.", repr(float(nh.stability_limit("five_leapfrogs"))))
