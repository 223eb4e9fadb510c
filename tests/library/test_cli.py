"""The command line: subcommands, formats, and exit status (0 yes, 1 no, 2 bad input with one message)."""

import csv
import io
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic import commands
from nearharmonic.cli import command_names, main
from nearharmonic.errors import NearharmonicError
from nearharmonic.output import table as answers
from nearharmonic.output.table import Answer

ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "src")}


def rows_of(capsys, *arguments):
    """CSV output of a command, as a mapping for each row."""
    assert main([*arguments, "--format", "csv"]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


@pytest.mark.slow
def test_list_prints_one_kind_or_all_in_order_of_registries(capsys):
    one = [row["name"] for row in rows_of(capsys, "list", "systems")]
    other = [row["name"] for row in rows_of(capsys, "list", "integrators")]
    modified = [row["name"] for row in rows_of(capsys, "list", "modified_integrators")]
    every = [row["name"] for row in rows_of(capsys, "list")]
    assert one == list(nh.systems)
    assert other == list(nh.integrators)
    assert modified == list(nh.modified_integrators)
    assert every == other + one


def test_a_format_is_that_of_the_same_rows(capsys):
    rows = rows_of(capsys, "list", "systems")
    assert main(["list", "systems", "--format", "json"]) == 0
    assert [{k: str(v) for k, v in row.items()} for row in json.loads(capsys.readouterr().out)] == rows
    assert main(["list", "systems"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:2] == ["name", "label"]
    assert [line.split()[0] for line in lines[1:]] == [row["name"] for row in rows]


def test_json_has_null_for_what_is_no_finite_number():
    answer = Answer(header=["a", "b"], rows=[[float("nan"), 1.5]], document={"x": [float("inf"), {"y": -float("inf")}]})
    assert json.loads(answers.printed(answer, "json"), parse_constant=pytest.fail) == {"x": [None, {"y": None}]}
    plain = Answer(header=["a", "b"], rows=[[float("nan"), 1.5]])
    assert json.loads(answers.printed(plain, "json"), parse_constant=pytest.fail) == [{"a": None, "b": 1.5}]


def test_empty_answer_prints_csv_header_json_list_and_table_notes():
    answer = Answer(header=["a", "b"], rows=[], notes=["no run"])
    assert [answers.printed(answer, form) for form in ("csv", "json", "table")] == ["a,b\n", "[]\n", "no run\n"]


def test_an_answer_with_a_short_row_is_refused():
    with pytest.raises(NearharmonicError, match="row 1 has 1 cells under 2 names"):
        Answer(header=["a", "b"], rows=[[1, 2], [3]])


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"nearharmonic {nh.__version__}\n"


def test_help_names_every_command_and_each_has_help(capsys):
    assert main(["--help"]) == 0
    overview = capsys.readouterr().out
    for name in command_names():
        assert f"\n  {name} " in overview
        assert main([name, "--help"]) == 0
        assert capsys.readouterr().out.startswith(f"usage: nearharmonic {name} ")


#: A module with one command more.
COMMAND = """
from nearharmonic.commands import Command
from nearharmonic.output.table import Answer
def answer(chosen): {body}
COMMANDS = {{"say-no": Command("say no", lambda parser: parser.add_argument("--sort"), answer)}}
"""


@pytest.fixture
def added(tmp_path, monkeypatch):
    """Add a command whose answer has this body."""

    def add(body):
        (tmp_path / "more.py").write_text(COMMAND.format(body=body))
        monkeypatch.setattr(commands, "__path__", [*commands.__path__, str(tmp_path)])
        monkeypatch.setitem(commands.MODULES, "more", ("say-no",))

    yield add
    sys.modules.pop(f"{commands.__name__}.more", None)


def test_a_module_adds_its_commands(added, capsys):
    added("return Answer(header=['sort'], rows=[[chosen.sort]], status=1)")
    assert main(["--help"]) == 0
    assert re.search(r"^  say-no +say no$", capsys.readouterr().out, re.MULTILINE)
    for given in (["--sort", "-tau_per_stage"], ["--sort=-tau_per_stage"]):
        assert main(["say-no", *given]) == 1
        assert capsys.readouterr().out.split() == ["sort", "-tau_per_stage"]


@pytest.mark.parametrize(
    ("raised", "status", "says"),
    [("KeyboardInterrupt", 130, ""), ("PermissionError(13, 'Permission denied', 'x.png')", 2, "Permission denied")],
)
def test_interrupt_is_quiet_and_unwritable_file_gives_one_message(raised, status, says, added, capsys):
    added(f"raise {raised}")
    assert main(["say-no"]) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert err.count("\n") == bool(says)


def output_of(*arguments, **variables):
    """Standard output and errors of a process that ends well."""
    environment, command = ENVIRONMENT | variables, [sys.executable, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout, done.stderr


def unread(*arguments):
    """(messages, exit status) of a process whose standard output nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, *arguments]
    done = subprocess.run(command, env=ENVIRONMENT, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    return done.stderr, done.returncode


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    ["list", "--help", "--version", "list --help", pytest.param("list --format json", marks=pytest.mark.slow)],
)
def test_a_reader_that_has_seen_enough_is_no_error(arguments):
    assert unread("-m", "nearharmonic.cli", *arguments.split()) == ("", 0)


def test_answer_status_survives_closed_output(tmp_path):
    (tmp_path / "more.py").write_text(COMMAND.format(body="return Answer(header=['a'], rows=[['x']], status=1)"))
    lines = ["import sys", "from nearharmonic import cli, commands", f"commands.__path__.append({str(tmp_path)!r})"]
    lines += ["commands.MODULES['more'] = ('say-no',)", "sys.exit(cli.main(['say-no']))"]
    assert unread("-c", "\n".join(lines)) == ("", 1)


def test_terminal_without_letters_of_name_shows_question_marks():
    shown, errors = output_of("-m", "nearharmonic.cli", "list", "systems", PYTHONIOENCODING="ascii")
    assert "H?non-Heiles" in shown
    assert errors == ""


def test_help_loads_no_library_that_is_slow_to_load():
    text = "import sys; from nearharmonic.cli import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    loaded = {name.partition(".")[0] for name in output_of("-c", text)[1].split()}
    assert not loaded & {"numpy", "xarray", "pandas", "h5py", "matplotlib", "numba", "tabulate", "rocrate", "bokeh"}


def test_help_loads_few_modules_and_makes_few_calls():
    """At present 75 modules and 46000 calls, a tenth of a second; numpy alone would double both."""
    text = (
        "import sys; from support.projects.call_counts import calls_of; loaded = len(sys.modules)\n"
        "def help():\n    from nearharmonic.cli import main\n    main(['--help'])\n"
        "print(calls_of(help), len(sys.modules) - loaded, file=sys.stderr)"
    )
    path = os.pathsep.join([str(ROOT / "tests"), ENVIRONMENT["PYTHONPATH"]])
    calls, modules = map(int, output_of("-c", text, PYTHONPATH=path)[1].split())
    assert calls < 80_000
    assert modules < 150


FULL = "nearharmonic: the answer cannot be written: No space left"


@pytest.mark.parametrize(
    ("words", "says", "status"),
    [
        ("list >&-", "nearharmonic: the answer cannot be written: the standard output is closed\n", 2),
        pytest.param("list >/dev/full", FULL, 2, marks=pytest.mark.slow),
        pytest.param("list >/dev/null 2>&-", "", 0, marks=pytest.mark.slow),
        pytest.param("lis 2>&-", "", 2, marks=pytest.mark.slow),
        pytest.param("lis 2>/dev/full", "", 2, marks=pytest.mark.slow),
        pytest.param("list >/dev/full 2>/dev/full", "", 2, marks=pytest.mark.slow),
        pytest.param("--version >/dev/full", FULL, 2, marks=pytest.mark.slow),
    ],
)
def test_closed_or_full_stream_ends_in_one_sentence(words, says, status):
    command = f"{shlex.quote(sys.executable)} -m nearharmonic.cli {words}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("", status)
    assert done.stderr.startswith(says)
    assert len(done.stderr.splitlines()) == bool(says)
