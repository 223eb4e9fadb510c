"""The command ``nearharmonic new``: new files run unchanged, and invalid names are refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import mpmath
import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.commands import new
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.integrators import integrators
from nearharmonic.systems import systems
from nearharmonic_paper.config import read

#: A line of a template that is an argument of the entry in a comment.
OPTION = re.compile(r"^    # (?=(\w+)=.*,$)", re.MULTILINE)


@pytest.fixture(autouse=True)
def _working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def well():
    assert main(["new", "system", "my_well"]) == 0
    return Path("my_well.py")


@pytest.fixture
def method():
    assert main(["new", "integrator", "my_method"]) == 0
    return Path("my_method.py")


def options_of(kind):
    return OPTION.findall((new.TEMPLATES / f"{kind}.py").read_text())


def with_option(place, option):
    """The path of a copy of a file in which an optional line is no comment."""
    changed = Path("changed.py")
    changed.write_text(re.sub(rf"^    # (?={option}=)", "    ", place.read_text(), flags=re.MULTILINE))
    return str(changed)


@pytest.mark.usefixtures("well")
def test_new_system_is_integrated_by_its_path_as_it_stands():
    run = nh.integrate("my_well.py", "babps9o7h", 0.2)
    assert (run.attrs["system"], run.status.item()) == ("my_well", "ok")
    assert run.max_energy_error < 1e-8
    # Any splitting keeps the angular momentum in a central potential: what is left is rounding in 500 steps.
    assert run.angular_momentum_drift < 1e-13


@pytest.mark.usefixtures("well")
def test_parameters_of_new_system_are_those_of_its_hamiltonian():
    # By hand at q = (1, 0), p = (0, 0.5): 0.25/2 + k/2 + b/4.
    assert nh.integrate("my_well.py", "ruth", 1.0, t_end=1).initial_energy.item() == pytest.approx(0.65, rel=1e-15)
    given = {"k": 3, "b": 2}
    run = nh.integrate("my_well.py", "ruth", 1.0, t_end=1, parameters=given)
    assert run.initial_energy.item() == pytest.approx(0.125 + 1.5 + 0.5, rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("option", options_of("system"))
def test_each_optional_line_of_a_new_system_is_correct(well, option):
    place = with_option(well, option)
    if option == "time_dependent":
        with pytest.raises(SystemDefinitionError, match="V"):
            nh.integrate(place, "ruth", 0.05)
        text = Path(place).read_text().replace("def V(q, k, b)", "def V(q, t, k, b)")
        Path(place).write_text(text)
    assert nh.integrate(place, "ruth", 0.05).max_energy_error < 1e-6
    assert getattr(systems[place], option) != getattr(systems[str(well)], option)


@pytest.mark.usefixtures("method")
def test_new_integrator_runs_by_path_and_has_declared_order():
    assert nh.order_of("my_method.py") == integrators["my_method.py"].order == 2
    errors = nh.sweep("sho", "my_method.py", [0.02, 0.01]).max_energy_error.values
    # 2^2; the next term of the error, tau^2 times a constant of about 10, is seen at 0.1 (3.93), not at 0.02.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.01)


@pytest.mark.usefixtures("method")
def test_coefficients_of_new_integrator_are_those_of_its_source():
    # Omelyan, Mryglod and Folk (2002): lambda = 1/2 - r/12 + 1/(6 r) with r^3 = 2 sqrt(326) + 36.
    root = mpmath.cbrt(2 * mpmath.sqrt(326) + 36)
    exact = mpmath.mpf(1) / 2 - root / 12 + 1 / (6 * root)
    tableau = integrators["my_method.py"]
    assert abs(mpmath.mpf(tableau.kick[0]) - exact) < mpmath.mpf(10) ** -tableau.digits
    assert (tableau.first, tableau.stages, tableau.drift) == ("kick", 2, ("0.5", "0.5"))


@pytest.mark.parametrize("option", options_of("integrator"))
def test_each_optional_line_of_a_new_integrator_is_correct(method, option):
    changed, plain = integrators[with_option(method, option)], integrators[str(method)]
    assert getattr(changed, option) != getattr(plain, option)


@pytest.mark.slow
@pytest.mark.parametrize("kind", new.KINDS)
def test_the_command_that_the_answer_names_runs_the_new_file(kind, capsys, monkeypatch):
    if kind == "system":  # which all methods are tried on, and take ten times as long
        few = {name: integrators[name] for name in ("ruth", "aba864")}
        monkeypatch.setattr("nearharmonic.recommendation.question.integrators", few)
    assert main(["new", kind, "mine"]) == 0
    told = capsys.readouterr().out
    (line,) = re.findall(r"^Run it: nearharmonic (.*)$", told, flags=re.MULTILINE)
    assert f"nearharmonic {line}\n" in Path("mine.py").read_text()
    assert main(line.split()) == 0
    assert "mine" in capsys.readouterr().out


def test_a_config_names_new_files_as_their_comments_say(well, method):
    (system,) = re.findall(r"^  my_well: .*$", well.read_text(), flags=re.MULTILINE)
    (methods,) = re.findall(r"^  (integrators: .*)$", method.read_text(), flags=re.MULTILINE)
    Path("mine.yaml").write_text(f"name: mine\n{methods}\nsystems:\n{system}\n")
    config = read(Path("mine.yaml"))
    assert [sweep.system for sweep in config.sweeps] == ["my_well"]
    assert systems["my_well"].invariants
    assert integrators["my_method"].label == "my_method"


def test_output_option_changes_file_and_name_in_its_text(capsys):
    assert main(["new", "system", "my_well", "-o", "models/well.py", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == [{"file": "models/well.py"}]
    assert "recommend models/well.py --error" in Path("models/well.py").read_text()
    assert systems["models/well.py"].name == "my_well"


def test_a_file_that_is_there_stays_as_it_is(capsys):
    Path("mine.py").write_text("x = 1\n")
    Path("link.py").symlink_to("nowhere")
    for name in ("mine", "link"):
        assert main(["new", "system", name]) == 2
        says = f"NAME = '{name}' is not allowed: {name}.py exists already, and is not overwritten"
        assert says in capsys.readouterr().err
    assert Path("mine.py").read_text() == "x = 1\n"
    assert not Path("nowhere").exists()


def test_module_below_working_folder_is_visible_without_fault(tmp_path, monkeypatch, capsys):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/theirs.py").write_text("")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours/__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "lib")
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["new", "system", "theirs"]) == 2
    assert "in place of the module theirs" in capsys.readouterr().err
    assert main(["new", "system", "ours"]) == 0


def test_name_of_one_kind_may_be_registered_for_other():
    assert main(["new", "system", "ruth"]) == 0
    assert systems["ruth.py"].name == "ruth"


def test_the_templates_are_part_of_the_package():
    import tomllib

    root = Path(__file__).parents[3]
    data = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    assert data["nearharmonic.commands"] == [f"{new.TEMPLATES.name}/*"]
    assert sorted(path.stem for path in new.TEMPLATES.glob("*.py")) == sorted(new.KINDS)
