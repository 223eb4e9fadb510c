"""Random hostile files for each reader: an answer or one sentence, no traceback, no code is run, nothing hangs."""

import json
import os
import re
import shlex
import signal
from contextlib import contextmanager
from pathlib import Path
from random import Random
from zipfile import ZipFile, ZipInfo

import h5py
import numpy as np
import pytest
import xarray as xr

from nearharmonic.cli import main
from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.exchange.files import read as read_coefficients
from nearharmonic.output import store
from nearharmonic.output.atomic import unsealed as opened
from nearharmonic.plotting.profile import problem_of
from nearharmonic.recommendation.measure import read_parts
from nearharmonic.registry import trusting_only
from nearharmonic_paper.config import read as read_config
from nearharmonic_paper.record import archive as check
from nearharmonic_paper.record import archive as pack
from support.hostile.mutations import FOREIGN, ODD_SETTINGS, change_file, make_foreign, mutated, mutated_bytes, resealed
from support.results.result_folder import edited, write_manifest

ROOT = Path(__file__).parents[3]
TABLEAUS = ROOT / "tests/library/exchange/tableaus"
#: Seconds that no case may take, on a busy machine.
LIMIT = 60

EVIL = "from pathlib import Path\n\nPath('ran').touch()\n"
RECORD = (
    "verify paper", "history paper --full", "show paper kepler ruth 50", "compare paper copy",
    "archive paper -o a.zip",
)  # fmt: skip


@contextmanager
def in_time():
    """Raise TimeoutError in a block that takes too long."""

    def stop(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LIMIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def hostile(project, copy):
    """The result with receipts and with a file that leaves a mark if it is run; ``copy`` is a copy of it as it was."""
    Path("evil.py").write_text(EVIL)
    entry = json.loads((project / "manifest.json").read_text())["files"]["cubes/kepler.h5"]
    more = {"modified": 1, "settings": "67" * 32, "evaluations": 5, "inputs": {}, "run": None}
    (project / "logs").mkdir()
    (project / "logs/reduce.json").write_text(resealed({"files": {"cubes/kepler.h5": entry | more}}))
    return project


def check_commands(commands, capsys):
    for command in commands:
        with in_time():
            status = main(shlex.split(command))
        told = capsys.readouterr()
        assert status in {0, 1, 2}, command
        assert len(told.err.splitlines()) == (1 if status == 2 else 0), (command, told.err)
        assert "\x1b" not in told.out + told.err, command
    assert not Path("ran").exists()


def change_document(place, random):
    document = opened(place.read_bytes())
    place.write_text(resealed(mutated(document, random)))


def change_history(place, random):
    """Change the last line, with a seal that is right or, as in an old version, none."""
    *others, last = place.read_text().splitlines()
    document = {key: value for key, value in json.loads(last).items() if key not in {"sha256", "before"}}
    changed = mutated(document, random)
    text = resealed(changed | {"before": None}) if random.random() < 0.5 else json.dumps(changed)
    place.write_text("\n".join([*(others if random.random() < 0.5 else ()), text, ""]))


def change_bytes(place, random):
    place.write_bytes(mutated_bytes(place.read_bytes(), random))


def change_cube(place, random):
    with edited(place) as file:
        change_file(file, random)
    write_manifest(place.parents[1])


#: Files of a result: how each is changed, and the commands that read it.
RESULTS = {
    "manifests": ("manifest.json", change_document, RECORD),
    "manifests, any bytes": ("manifest.json", change_bytes, RECORD[:1]),
    "histories": ("history.jsonl", change_history, (*RECORD, "history")),
    "histories, any bytes": ("history.jsonl", change_bytes, RECORD[:2]),
    "receipts": ("logs/reduce.json", change_document, RECORD[:1]),
    "receipts, any bytes": ("logs/reduce.json", change_bytes, RECORD[:1]),
    "cubes": ("cubes/kepler.h5", change_cube, ("runs paper", "show paper kepler ruth 50", "compare paper copy")),
    "claims": ("tables/claims.json", change_bytes, ("compare paper copy",)),
    "tables": ("tables/methods.csv", change_bytes, ("compare paper copy",)),
}


#: Seeds whose cubes were once answered by a traceback: attributes that are no text, step sizes that are not positive.
FOUND = {"cubes": (368, 577, 595, 944)}


def try_results(kind, seeds, hostile, capsys, trials):
    name, change, commands = RESULTS[kind]
    campaign, place = trials(f"F. {kind}"), hostile / name
    kept = {path: path.read_bytes() for path in (place, hostile / "manifest.json")}
    for seed in seeds:
        with campaign.case(seed):
            change(place, Random(f"{kind} {seed}"))
            check_commands(commands, capsys)
        capsys.readouterr()
        for path, content in kept.items():
            path.write_bytes(content)


@pytest.mark.slow
@pytest.mark.parametrize("kind", RESULTS)
def test_hostile_result_is_answered_or_refused(kind, hostile, capsys, trials):
    try_results(kind, [*range(4), *FOUND.get(kind, ())], hostile, capsys, trials)


@pytest.mark.long
@pytest.mark.parametrize("kind", RESULTS)
def test_many_hostile_results_are_answered_or_refused(kind, hostile, capsys, trials):
    try_results(kind, range(4, 1000), hostile, capsys, trials)


#: Values in place of a variable of a cube whose type or shape is another.
ODD_SHAPES = {
    "scalar": lambda file, name, shape, other: 1.0,
    "text": lambda file, name, shape, other: file.create_dataset(name, shape, h5py.string_dtype()),
    "number": lambda file, name, shape, other: file.create_dataset(name, data=np.zeros(shape)),
    "one axis": lambda file, name, shape, other: np.zeros(shape[-1]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cubes/kepler.h5", "runs/kepler/ruth/0.h5"])
@pytest.mark.parametrize("kind", FOREIGN)
def test_file_that_reaches_outside_is_one_sentence(name, kind, project, copy, capsys):
    os.mkfifo("pipe")
    variable = "max_energy_error" if name.startswith("cubes") else "energy_error"
    with edited(project / name) as file:
        make_foreign(file, variable, FOREIGN[kind], Path("pipe").absolute())
    write_manifest(project)
    check_commands(RESULTS["cubes"][2], capsys)
    for command in ("verify paper", "archive paper"):
        with in_time():
            assert main(command.split()) == 1
        assert re.search(rf"{name} +has /{variable}.*, which", capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ODD_SHAPES)
@pytest.mark.parametrize("variable", ["max_energy_error", "status", "label", "steps"])
def test_variable_of_another_shape_is_one_sentence(kind, variable, hostile, capsys):
    with edited(hostile / "cubes/kepler.h5") as file:
        make_foreign(file, variable, ODD_SHAPES[kind], "")
    write_manifest(hostile)
    check_commands((*RESULTS["cubes"][2], "compare paper copy --figure a.png"), capsys)


@pytest.mark.slow
@pytest.mark.parametrize("settings", ODD_SETTINGS)
def test_settings_of_no_job_are_one_sentence(settings, hostile, capsys):
    for name in ("cubes/kepler.h5", "runs/kepler/ruth/0.h5"):
        with edited(hostile / name) as file:
            file.attrs["settings"] = settings
    write_manifest(hostile)
    check_commands(RESULTS["cubes"][2], capsys)


@pytest.mark.parametrize("settings", ODD_SETTINGS)
def test_odd_settings_are_no_title_and_odd_problems_refused(settings, tmp_path):
    assert problem_of(xr.Dataset(attrs={"settings": settings})) == ""
    steps = (("x",), np.ones(2), {"units": "1", "long_name": "steps"})
    store.write(tmp_path / "work_precision.h5", {"steps": steps}, {"problems": settings})
    with pytest.raises(ResultFileError, match="has other variables or settings than its job writes"):
        read_parts(tmp_path / "work_precision.h5", "kepler")


def changed_text(document, random):
    return json.dumps(mutated(document, random, deepest=400))


def change_archive(place, random):
    """Change names, modes and contents of members, under a seal that is right."""
    with ZipFile(place) as zipped:
        members = [(one.filename, zipped.read(one)) for one in zipped.infolist()]
    with ZipFile(place, "w") as zipped:
        zipped.comment = check.BLANK
        for name, content in members:
            member = ZipInfo(
                random.choice(("../../x", "/x", "a/b", "manifest.json")) if random.random() < 0.02 else name
            )
            member.external_attr = random.choice((0o120777, 0o100644, 0)) << 16 if random.random() < 0.02 else 0
            told = name.endswith(".json") and random.random() < 0.3
            zipped.writestr(member, changed_text(json.loads(content), random) if told else content)
    check.close(place)


def try_archives(seeds, whole, capsys, trials):
    place = Path("hostile.zip")
    for kind, change in {"archives": change_archive, "archives, any bytes": change_bytes}.items():
        campaign = trials(f"F. {kind}")
        for seed in seeds:
            with campaign.case(seed):
                place.write_bytes(whole)
                change(place, Random(f"{kind} {seed}"))
                check_commands(["verify hostile.zip"], capsys)
            capsys.readouterr()


@pytest.fixture
def whole(hostile):
    """The bytes of an archive of the result."""
    return pack.save(hostile, "whole.zip").read_bytes()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_hostile_archive_is_answered_or_refused(whole, capsys, trials):
    try_archives(range(10), whole, capsys, trials)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_many_hostile_archives_are_answered_or_refused(whole, capsys, trials):
    try_archives(range(10, 2000), whole, capsys, trials)


def refusal(read, place):
    """The sentence by which a reader refuses a file; empty if it reads it."""
    try:
        read(place)
    except NearharmonicError as error:
        return str(error)
    return ""


def try_inputs(kind, sources, read, seeds, trials):
    campaign = trials(f"F. {kind}")
    for seed in seeds:
        random = Random(f"{kind} {seed}")
        source = random.choice(sources)
        with campaign.case((seed, source.name)):
            place = Path(f"hostile{source.suffix}")
            place.write_bytes(mutated_bytes(source.read_bytes(), random))
            with in_time(), trusting_only([]):
                said = refusal(read, place)
            assert len(said.splitlines()) <= 1
            assert not Path("ran").exists()


def configs():
    return [ROOT / "tests/workflow/tiny.yaml", ROOT / "config/smoke.yaml", *sorted(ROOT.glob("examples/*.yaml"))]


def tableaus():
    """Files of coefficients in TOML and CSV, and one in JSON."""
    found = sorted((TABLEAUS / "published").iterdir())
    place = Path("tableau.json")
    rows = {"kick": ["0.5", "0.5"], "drift": ["1"], "order": 2, "first": "kick", "symmetric": True, "digits": 16}
    place.write_text(json.dumps(rows))
    return [*found, *[place] * len(found)]


def few_or_many(few, many):
    """Run a test with few seeds, and behind the marker ``long`` with many."""
    seeds = [range(few), pytest.param(range(few, many), marks=pytest.mark.long)]
    return pytest.mark.parametrize("seeds", seeds, ids=["few", "many"])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a file that leaves a mark if it is run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text(EVIL)
    return tmp_path


@few_or_many(15, 3000)
def test_hostile_config_is_read_or_refused(folder, seeds, trials):
    try_inputs("configs", configs(), read_config, seeds, trials)


@few_or_many(40, 5000)
def test_hostile_tableau_is_read_or_refused(folder, seeds, trials):
    try_inputs("tableaus", tableaus(), lambda place: read_coefficients(str(place)), seeds, trials)
