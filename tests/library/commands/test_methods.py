"""Commands export, new and verify-tableau."""

import json
import re
from pathlib import Path

import mpmath
import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.commands import methods
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.files import export
from nearharmonic.integrators import integrators
from nearharmonic.systems import systems
from nearharmonic_paper.config import read
from support.methods.tableau_files import path

# --- nearharmonic export: texts for other programs, and errors for unsupported input


OWN = """
from nearharmonic import Tableau, palindrome

TABLEAUS = tuple(
    Tableau(name=name, order=2, first="drift", drift=palindrome("2e-1", "+.3"), kick=palindrome("0.35", centre="0.3"),
            source="made up", digits=20)
    for name in ("mine", "other")
)
"""


@pytest.mark.parametrize("to", TARGETS)
def test_the_text_alone_is_printed(to, capsys):
    assert main(["export", "ruth", "--to", to, "--digits", "20"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == (export(integrators["ruth"], to, 20), "")


def test_json_of_the_answer_holds_the_text(capsys):
    assert main(["export", "ruth", "--to", "c", "--format", "json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found == {"integrator": "ruth", "to": "c", "text": export(integrators["ruth"], "c")}


def test_an_integrator_of_a_file_is_exported_by_its_path(tmp_path, capsys):
    (tmp_path / "methods.py").write_text(OWN, encoding="utf-8")
    assert main(["export", f"{tmp_path}/methods.py:other", "--to", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["drift"] == ["0.2", "0.3", "0.3", "0.2"]
    assert main(["export", f"{tmp_path}/methods.py", "--to", "json"]) == 2
    assert "defines 2 integrators: name one, as in" in capsys.readouterr().err


# --- The command nearharmonic new: new files run unchanged, and invalid names are refused


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
    return OPTION.findall((methods.TEMPLATES / f"{kind}.py").read_text())


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
@pytest.mark.parametrize("kind", methods.KINDS)
def test_the_command_that_the_answer_names_runs_the_new_file(kind, capsys, monkeypatch):
    if kind == "system":  # which all methods are tried on, and take ten times as long
        few = {name: integrators[name] for name in ("ruth", "aba864")}
        monkeypatch.setattr("nearharmonic.recommendation.search.integrators", few)
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


# --- nearharmonic verify-tableau: words, JSON and exit status


def test_failing_claim_gives_status_1_and_its_proof(capsys):
    assert main(["verify-tableau", path("libraries", "desolver_babs9o7h")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "BABs9o7H of desolver: 1 of 2 claims does not hold"
    start = "order = 7 for every separable H  no       order 4: the conditions up to degree 4 vanish"
    assert lines[3].startswith(start)
    assert "one of degree 5 is off by -2.6e-05 (16 digits allow 4.1e-17)" in lines[3]
    assert "nearest registered method: BAB's9o7H (babps9o7h): the same to all digits" in lines
    assert main(["verify-tableau", path("published", "mclachlan_atela_4")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "order: 3 for every separable H, 4 for quadratic T, 4 on the oscillator" in lines


@pytest.mark.slow
def test_degree_of_the_potential_adds_its_order(capsys):
    assert main(["verify-tableau", path("published", "na7"), "--degree", "3"]) == 0
    assert "order: 6 for quadratic T and V of degree 3" in capsys.readouterr().out.splitlines()
    assert main(["verify-tableau", path("published", "na7"), "--degree", "2", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["polynomial_order"]["degree"], found["polynomial_order"]["order"]) == (2, found["oscillator_order"])
    assert main(["verify-tableau", path("published", "na7"), "--degree", "1"]) == 2
    assert "degree = '1' is not allowed: an integer from 2" in capsys.readouterr().err


@pytest.mark.parametrize(("kind", "name", "status"), [("published", "na7", 0), ("damaged", "sign", 1)])
def test_json_holds_every_claim_and_what_is_proved(kind, name, status, capsys):
    assert main(["verify-tableau", path(kind, name), "--format", "json"]) == status
    found = json.loads(capsys.readouterr().out)
    assert found["holds"] == (status == 0)
    assert {claim["says"].partition(" ")[0] for claim in found["claims"]} >= {"rows", "order"}
    assert (found["first"], found["kicks"], found["drifts"], found["symmetric"]) == ("drift", 7, 8, True)
    if status == 0:
        assert (found["order"]["order"], found["quadratic_order"]["order"], found["harmonic_order"]) == (4, 6, 6)
        assert found["quadratic_order"]["failing"]["degree"] == 7
        assert found["suspects"] == []
    else:
        (suspect,) = found["suspects"]
        assert suspect["kick"][2].startswith("-0.197")
        assert found["stability_limit"] is None


def test_a_file_as_export_writes_it_is_read(tmp_path, capsys):
    from nearharmonic.integrators import integrators

    t = integrators["aba864"]
    document = {
        "name": t.name, "label": t.label, "source": t.source, "order": t.order, "harmonic_order": t.harmonic_order,
        "requires": t.requires, "first": t.first, "digits": t.digits, "kick": list(t.kick), "drift": list(t.drift),
    }  # fmt: skip
    (tmp_path / "aba864.json").write_text(json.dumps(document))
    assert main(["verify-tableau", str(tmp_path / "aba864.json")]) == 0
    assert "nearest registered method: ABA864 (aba864): the same to all digits" in capsys.readouterr().out


def test_python_file_of_integrator_is_verified_like_its_export(capsys):
    from pathlib import Path

    example = Path(__file__).parents[3] / "examples/fourth_order.py"
    for place in (str(example), f"{example}:five_leapfrogs"):
        assert main(["verify-tableau", place]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "five leapfrogs: all claims hold"
        assert any(line.startswith("order = 4 for every separable H") for line in lines)
    assert main(["verify-tableau", f"{example}:six"]) == 2
    assert "unknown integrator" in capsys.readouterr().err


def test_status_of_several_files_is_that_of_worst(capsys):
    good, bad = path("libraries", "suzuki_yoshida_7"), path("libraries", "desolver_babs9o7h")
    assert main(["verify-tableau", good, good]) == 0
    assert main(["verify-tableau", good, bad]) == 1
    assert main(["verify-tableau", good, bad, "none.toml"]) == 2
    assert capsys.readouterr().err == "nearharmonic: none.toml: there is no such file\n"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["json", *(pytest.param(form, marks=pytest.mark.slow) for form in ("table", "csv"))])
def test_answer_for_several_files_holds_each_answer(form, capsys):
    files = [path("libraries", name) for name in ("suzuki_yoshida_7", "desolver_babs9o7h")]
    single = []
    for file in files:
        main(["verify-tableau", file, "--format", form])
        single.append(capsys.readouterr().out)
    main(["verify-tableau", *files, "--format", form])
    found = capsys.readouterr().out
    if form == "table":
        assert found == "\n".join(single)
    elif form == "json":
        assert json.loads(found) == list(map(json.loads, single))
    else:
        rows = [f"{file},{row}" for file, text in zip(files, single, strict=True) for row in text.splitlines()[1:]]
        assert found.splitlines() == ["file,claim,holds,proof", *rows]


def test_nothing_is_printed_if_one_of_several_is_unreadable(capsys):
    assert main(["verify-tableau", path("libraries", "suzuki_yoshida_7"), "none.toml"]) == 2
    assert capsys.readouterr().out == ""
