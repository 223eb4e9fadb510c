"""Commands recommend and tailor."""

import fcntl
import json
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.cli import main

# --- The command nearharmonic recommend: its options, and JSON that agrees with the Dataset


METHODS = "ruth,aba864, babps9o7h"


def told(capsys, command, *words):
    """(what JSON holds, exit status) of a command."""
    status = main([command, *words, "--format", "json"])
    return json.loads(capsys.readouterr().out), status


def test_interval_methods_and_budget_are_those_of_the_options(capsys):
    words = ["--error", "1e-6", "--t-end", "50", "--methods", METHODS, "--budget", "5000"]
    document, status = told(capsys, "recommend", "henon_heiles", *words)
    assert (status, document["t_end"], document["budget"], document["error"]) == (0, "50", 5000, 1e-6)
    assert {choice["method"] for choice in document["choices"]} == {"ruth", "aba864", "babps9o7h"}
    for choice in document["choices"]:
        run = nh.integrate("henon_heiles", choice["method"], choice["tau"], t_end="50", summation=choice["summation"])
        assert run.max_energy_error.item() == choice["error"] == choice["max_energy_error"] <= 1e-6
        assert run.evaluations.item() == choice["evaluations"] <= 5000


@pytest.mark.slow
def test_missed_error_gives_no_rank_and_status_1_for_all(capsys):
    words = ["sho", "--error", "1e-6", "--methods", "leapfrog,babps9o7h"]
    document, status = told(capsys, "recommend", *words, "--budget", "20000")
    assert status == 0
    assert [(choice["rank"], choice["status"]) for choice in document["choices"]] == [(1, "met"), (None, "missed")]
    document, status = told(capsys, "recommend", *words, "--budget", "100")
    assert status == 1
    assert {choice["rank"] for choice in document["choices"]} == {None}


def test_interval_of_option_takes_place_of_that_of_config(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(
        "name: mine\nintegrators: [ruth]\nsystems:\n  far:\n    system: sho\n    q0: [2]\n    t_end: 30\n"
        "    tau_per_stage: {lowest: 0.01, highest: 1, points_per_decade: 20}\n"
    )
    words = ["far", "--config", "mine.yaml", "--error", "1e-3", "--methods", "ruth"]
    document, _ = told(capsys, "recommend", *words)
    assert (document["t_end"], document["call"]) == ("30", "")  # no Python without the config
    assert told(capsys, "recommend", *words, "--t-end", "12.5")[0]["t_end"] == "12.5"


@pytest.mark.slow
def test_ten_rows_names_and_python_of_the_first(capsys):
    words = ["recommend", "sho", "--error", "1e-3", "--budget", "3000", "--results", "/nowhere"]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in lines if re.match(r" +\d+ ", line)]
    assert len(rows) == 10
    assert all(row[1] in nh.integrators.registered for row in rows)
    (more,) = re.findall(r"^(\d+) more meet the error: --limit (\d+)$", "\n".join(lines), re.MULTILINE)
    assert int(more[1]) == int(more[0]) + 10
    call = lines[-1].removeprefix("the best in Python: ")
    assert eval(call, {"nh": nh}).max_energy_error <= 1e-3
    assert main([*words, "--limit", "1", "--methods", "verlet,BAB's8o7H,6A8"]) == 0
    (row,) = re.findall(r"^ +\d+ .*", capsys.readouterr().out, re.MULTILINE)
    assert row.split()[1] in ("babps8o7h", "nystrom_6a8")  # leapfrog needs 20 times as many evaluations


@pytest.mark.long
def test_other_libraries_are_left_out_if_methods_are_named(capsys):
    with_all, _ = told(capsys, "recommend", "sho", "--error", "1e-2", "--budget", "2000", "--results", "/nowhere")
    assert "other libraries: not timed (/nowhere" in with_all["basis"]
    named, _ = told(capsys, "recommend", "sho", "--error", "1e-2", "--budget", "2000", "--methods", "ruth")
    assert "other libraries" not in named["basis"]


# --- nearharmonic tailor: the file that it writes is used everywhere, Ctrl-C gives the best so far, and bad input


QUICK = ("henon_heiles", "--window", "0.08:0.12", "--trials", "500")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A folder with a method for the Henon-Heiles system in a folder that was not there, and what was printed."""
    folder = tmp_path_factory.mktemp("tailor")
    place = Path.cwd()
    os.chdir(folder)
    try:
        assert main(["tailor", *QUICK, "--output", "methods/my_method.py", "--format", "json"]) == 0
    finally:
        os.chdir(place)
    return folder


@pytest.fixture
def place(project, monkeypatch):
    monkeypatch.chdir(project)
    return "methods/my_method.py"


def test_the_file_is_an_integrator_by_its_path(place):
    tableau = nh.integrators[place]
    assert (tableau.name, tableau.stages, tableau.order, tableau.digits) == ("my_method", 8, 4, 60)
    assert "seed 0" in tableau.source
    assert "0.08 to 0.12 per stage" in tableau.source
    assert nh.integrate("henon_heiles", place, 0.8, t_end=50).max_energy_error < 1e-6
    text = Path(place).read_text(encoding="utf-8")
    assert "starts that were not used" in " ".join(text.split())


@pytest.mark.slow
def test_the_same_seed_and_trials_give_the_same_method(place, capsys):
    document, status = told(capsys, "tailor", *QUICK)
    own, method = nh.integrators[place], document["method"]
    assert status == 0
    assert (tuple(method["kick"]), tuple(method["drift"])) == (own.kick, own.drift)
    assert (document["file"], document["has_gain"]) == (None, True)
    assert document["gain"]["low"] > 0
    assert len(document["steps"]) == 5


def test_verify_tableau_proves_the_file(place, capsys):
    assert main(["verify-tableau", place, "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["name"] == "my_method"
    says = [claim["says"] for claim in found["claims"]]
    assert says[:3] == ["rows sum to 1", "symmetric = true", "order = 4 for every separable H"]
    assert any(claim.startswith("harmonic_order = ") for claim in says)


def test_without_gain_status_is_1_and_nothing_is_written(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["henon_heiles", "--window", "0.08:0.12", "--stages", "5", "--trials", "20", "--output", "mine.py"]
    assert main(["tailor", *words]) == 1
    out = capsys.readouterr().out
    assert "no gain, -" in out.splitlines()[0]
    assert out.splitlines()[0].endswith("take trained_fine")
    (call,) = re.findall(r"^trained_fine in Python: (nh\..*)$", out, flags=re.MULTILINE)
    assert eval(call, {"nh": nh}).max_energy_error < 1e-5  # the table has errors from 1.4e-7 to 3.4e-6
    assert "not written: mine.py, as there is no gain" in out
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_step_sizes_without_a_gain_are_named(capsys):
    """A method for a window that is a factor 3 wide is not the best in all of it."""
    assert main(["tailor", "relativistic_oscillator", "--window", "0.05:0.15", "--trials", "500"]) == 0
    title, _, *lines = capsys.readouterr().out.splitlines()
    low = {line.split()[0]: float(line.split()[5]) for line in lines[:11]}
    assert title.endswith(", though not in all of the window")
    (note,) = [line for line in lines if line.startswith("no gain at tau/s = ")]
    places = note.removeprefix("no gain at tau/s = ").partition(";")[0]
    named = {place.partition(":")[0] for place in places.split(", ")}
    assert {tau for tau, bound in low.items() if bound < 0} <= named
    assert named <= {tau for tau, bound in low.items() if bound <= 0}  # printed with three decimals
    assert 0 < len(named) < len(low)


@pytest.mark.slow
def test_system_of_file_in_its_own_units_is_taken(capsys, tmp_path):
    assert main(["new", "system", "well", "--output", str(tmp_path / "well.py")]) == 0
    capsys.readouterr()
    document, status = told(capsys, "tailor", str(tmp_path / "well.py"), "--trials", "40", "--stages", "6")
    assert status in (0, 1)
    assert document["system"] == "well"
    assert document["window"][1] / document["window"][0] == pytest.approx(1.5, rel=0.01)


@pytest.mark.parametrize(
    ("output", "says"), [("here.py", "here.py exists already"), ("here.py/mine.py", "here.py is no folder")]
)
def test_a_file_that_is_there_stays_as_it_is(output, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("here.py").write_text("x = 1\n")
    assert main(["tailor", "sho", "--output", output]) == 2
    assert says in capsys.readouterr().err
    assert Path("here.py").read_text() == "x = 1\n"


@pytest.mark.slow
def test_ctrl_c_on_terminal_gives_best_so_far_behind_bar():
    reader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    environment = {**os.environ, "PYTHONPATH": str(Path(nh.__file__).parents[1])}
    words = ["tailor", "henon_heiles", "--window", "0.08:0.12", "--seconds", "300"]
    process = subprocess.Popen(
        [sys.executable, "-m", "nearharmonic.cli", *words], stderr=terminal, stdout=subprocess.PIPE, env=environment,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    shown = b""
    while b"objective -" not in shown and process.poll() is None:
        if select.select([reader], [], [], 0.2)[0]:
            shown += os.read(reader, 65536)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate()
    os.close(terminal)
    os.close(reader)
    assert b"Ctrl-C for the best so far" in shown
    assert process.returncode in (0, 1)
    assert " s until Ctrl-C, " in out.decode()
