"""``nearharmonic show``: the requested run, its files, and Python code that reproduces its numbers."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from support.results.result_folder import edited, run_id


def shown(capsys, *arguments):
    assert main(["show", "paper", *arguments, "--format", "json"]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


QUESTIONS = [
    ("sho", "ruth", "0.006"),
    ("sho", "babps9o7h", "0.0388", "--precision", "extended"),
    ("sho", "ruth", "2.78"),
    ("henon_heiles", "babps9o7h", "0.7"),
    ("kepler", "babps9o7h", "159"),
    ("kepler", "ruth", "10", "--per-stage"),
]


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=" ".join)
def test_the_lines_of_python_print_the_number_of_the_cube(project, question, capsys):
    assert main(["show", "paper", *question]) == 0
    text = capsys.readouterr().out
    lines = text[text.index("import nearharmonic as nh") :]
    names = {}
    exec(compile(lines, "shown", "exec"), names)
    printed = float(capsys.readouterr().out)
    told = shown(capsys, *question)
    run, again = told["run"], names["run"]
    with h5py.File(project / f"cubes/{question[0]}.h5") as cube:
        assert printed in cube["max_energy_error"][()]
    assert run["max_energy_error"] == (printed if np.isfinite(printed) else None)
    for name in ("tau", "steps", "evaluations", "status", "diverged_at"):
        assert again[name].item() == run[name], name
    assert told["python"] == lines.removesuffix("\n")


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=" ".join)
def test_run_file_holds_run_with_stated_number_of_samples(project, question, capsys):
    told = shown(capsys, *question)
    path = project / told["files"]["run file"]["path"]
    with h5py.File(path) as file:
        group = file["extended"] if told["run"]["precision"] == "extended" else file
        (row,) = np.flatnonzero(group["tau_per_stage"][()] == told["run"]["tau_per_stage"])
        assert group["steps"][row] == told["run"]["steps"]
        assert np.isfinite(group["t"][row]).sum() == told["samples_kept"]
    for entry in told["files"].values():
        assert entry["sha256"] == sha256((project / entry["path"]).read_bytes()).hexdigest()
        assert entry["run"] == run_id(8)


def test_settings_and_units_are_those_of_sweep_and_system(project, capsys):
    told = shown(capsys, "kepler", "ruth", "30")
    assert (told["settings"]["t_end"], told["settings"]["samples"]) == ("8766", 50)
    assert told["system_units"] == dict(nh.systems["kepler"].units)
    assert told["units"]["perihelion_advance"] == "rad"
    assert main(["show", "paper", "kepler", "ruth", "30"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["setting", "t_end", "8766", "h"] in lines
    assert ["max_energy_error", repr(told["run"]["max_energy_error"]), "-"] in lines


def test_nearest_run_is_taken_and_named_if_it_is_another(project, capsys):
    assert main(["show", "paper", "kepler", "ruth", "160"]) == 0
    assert capsys.readouterr().out.startswith("The run nearest to tau = 160 has tau = 168.577 h\n")
    assert main(["show", "paper", "kepler", "ruth", "168.577"]) == 0
    assert capsys.readouterr().out.startswith("field")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["kepler", "ruth", "5000"], "steps from 30.0205 to 302.276, the nearest 168.577 and 302.276"),
        (["kepler", "ruth", "1"], "tau = 1.0 is not allowed"),
        (["sho", "babps9o7h", "5", "--precision", "extended"], "steps from 0.0179986 to 0.083612, the nearest"),
        (["keplr", "ruth", "30"], "unknown system 'keplr'. Did you mean 'kepler'? Known: henon_heiles, kepler, sho"),
        (["kepler", "rut", "30"], "unknown integrator 'rut'. Did you mean 'ruth'? Known: babps9o7h, ruth"),
        (["kepler", "ruth", "small"], "tau = 'small' is not allowed: a finite number above 0"),
        (["kepler", "ruth", "30", "--precision", "extended"], "precision = 'extended' is not allowed: one of double"),
    ],
)
def test_absent_run_is_refused_with_nearest_ones(project, arguments, says, capsys):
    assert main(["show", "paper", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err


def test_damaged_line_of_history_is_told(project, copy, capsys):
    first, *rest = (project / "history.jsonl").read_text().splitlines(keepends=True)
    (project / "history.jsonl").write_text(first[:-9] + "\n" + "".join(rest))
    for command in ("show paper kepler ruth 30", "compare paper copy", "compare copy paper"):
        main(command.split())
        assert "results/paper/history.jsonl: line 1 is damaged: its seal does not match, and" in capsys.readouterr().out


def test_results_without_trajectories_or_manifest_say_so(project, capsys):
    shutil.rmtree(project / "runs")
    (project / "manifest.json").unlink()
    told = shown(capsys, "kepler", "ruth", "30")
    assert list(told["files"]) == ["cube"]
    assert told["samples_kept"] is None
    assert main(["show", "paper", "kepler", "ruth", "30"]) == 0
    text = capsys.readouterr().out
    assert "The results have no run file with this trajectory" in text
    assert "results/paper has no manifest.json" in text


def test_cube_without_settings_is_shown_without_them(project, capsys):
    with edited(project / "cubes/kepler.h5") as file:
        del file.attrs["settings"]
    told = shown(capsys, "kepler", "ruth", "30")
    assert told["settings"] == {}
    assert "t_end" not in told["python"]
    compile(told["python"], "shown", "exec")


# --- docs/how_to/record.md and README's section on it: commands run, columns exist, numbers come again.

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/record.md").read_text(encoding="utf-8")
SECTION = re.split(r"^## ", (ROOT / "README.md").read_text(encoding="utf-8").partition("## Ask the results")[2])[0]
COMMANDS = {
    *re.findall(r"^(?:\.venv/bin/)?nearharmonic ((?:history|runs|show|compare)\b.*)$", PAGE + SECTION, re.MULTILINE)
}


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_a_command_of_the_page_runs(project, command, capsys):
    shutil.copytree(project, project.with_name("smoke"))
    # The small result has fewer step sizes than the default config's.
    words = [{"36": "150", "0.001": "0.002", "0.01": "0.018"}.get(word, word) for word in shlex.split(command)]
    assert main(words) == 0
    assert capsys.readouterr().out


def test_lines_of_python_on_page_print_number_beside_them(capsys):
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(block, "record.md", "exec"), {})
    assert capsys.readouterr().out.strip() == re.search(r"# (\S+)", block)[1]
