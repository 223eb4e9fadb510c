"""A changed bit, or no file at all, in finished results: never a wrong number, a crash or an endless loop."""

import os
import random
import shutil
from functools import partial
from pathlib import Path

import pytest

from support.projects.workflow_project import ROOT, TINY
from support.trials.damage import Readers, damaged, flip_bit

FOLDER = "results/tiny"
VERIFY = ("nearharmonic", "verify", FOLDER)
RUNS = ("nearharmonic", "runs", FOLDER, "--format", "csv")
SHOW = ("nearharmonic", "show", FOLDER, "sho", "ruth", "0.1", "--format", "csv")
COMPARE = ("nearharmonic", "compare", FOLDER, "results/sound")
HISTORY = ("nearharmonic", "history", FOLDER, "--format", "csv")
REMAKE = ("all", "-j2", *TINY)

#: Kind of file -> a pattern of its files, the questions to readers, and how many bits are flipped in a long campaign.
KINDS = {
    "run": ("results/tiny/runs/*/*/*.h5", [VERIFY, ("numbers", "{file}")], 400),
    "cube": ("results/tiny/cubes/*.h5", [VERIFY, RUNS, SHOW, ("numbers", "{file}")], 400),
    "table": ("results/tiny/tables/*.*", [VERIFY, COMPARE], 200),
    "figure": ("results/tiny/figures/*.*", [VERIFY], 200),
    "page": ("results/tiny/report.html", [VERIFY], 100),
    "history": ("results/tiny/history.jsonl", [VERIFY, HISTORY, SHOW], 150),
    "receipt": ("results/tiny/logs/*/*.json", [VERIFY, RUNS, SHOW], 150),
    "manifest": ("results/tiny/manifest.json", [VERIFY, RUNS, SHOW, COMPARE], 150),
    "archive": ("tiny.zip", [("nearharmonic", "verify", "{file}")], 100),
    "kernel": ("kernels/*.kernel", [("kernel", "{file}")], 100),
    "plan": ("frozen/*.job", [("job", "{file}")], 100),
}

#: What else may stand in the place of a file.
IN_PLACE = {
    "cut": lambda path: os.truncate(path, path.stat().st_size * 2 // 3),
    "empty": lambda path: os.truncate(path, 0),
    "foreign": lambda path: path.write_bytes(random.Random(1).randbytes(4096)),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"\n"),
    "pipe": lambda path: (path.unlink(), os.mkfifo(path)),
    "folder": lambda path: (path.unlink(), path.mkdir()),
    "dangling link": lambda path: (path.unlink(), path.symlink_to("nothing")),
    "lost": Path.unlink,
}
#: No damage: a receipt or a history may be absent, and white space at the end of JSON tells nothing.
HARMLESS = {
    ("receipt", "lost"), ("receipt", "dangling link"), ("history", "lost"), ("history", "empty"),
    *((kind, "longer") for kind in ("receipt", "history", "manifest")),
}  # fmt: skip


@pytest.fixture(scope="module")
def kept(finished, tmp_path_factory):
    """A copy of the finished project with an archive, frozen jobs and compiled code, to damage and to mend."""
    project = finished.copy(tmp_path_factory.mktemp("damage") / "project")
    shutil.copytree(project.results, project.folder / "results/sound")
    done = project.nearharmonic("archive", FOLDER, "-o", "tiny.zip")
    assert done.returncode == 0, done.stderr
    frozen = ROOT / "tests/support/projects/frozen_jobs.py"
    done = project.python(str(frozen), TINY[1], f"{FOLDER}/runs/sho/ruth/0.h5", "frozen")
    assert done.returncode == 0, done.stderr
    (project.folder / "kernels").mkdir(mode=0o700)
    script = "from nearharmonic.core import disk; from pathlib import Path; "
    script += "disk.write(Path('kernels/advance.kernel'), 'advance', bytes(range(256)) * 8)"
    assert project.python("-c", script).returncode == 0
    return project


@pytest.fixture(scope="module")
def readers(kept):
    readers = Readers(kept.folder)
    yield readers
    readers.close()


def files_of(kept, kind):
    """Names of the files of one kind."""
    return sorted(str(path.relative_to(kept.folder)) for path in kept.folder.glob(KINDS[kind][0]))


def questions_about(file, kind, readers):
    """Questions about a file, whose answers for the sound file are learnt."""
    asked = [tuple(word.format(file=file) for word in question) for question in KINDS[kind][1]]
    readers.learn(asked)
    return asked


def name_in_answers(file):
    return "" if file == "tiny.zip" else file.removeprefix(f"{FOLDER}/")


def flip(campaign, kept, readers, kind, number):
    """Flip ``number`` bits of files of one kind, one at a time."""
    draw, files = random.Random(kind), files_of(kept, kind)
    for _ in range(number):
        file = draw.choice(files)
        asked = questions_about(file, kind, readers)
        path = kept.folder / file
        bit = draw.randrange(8 * path.stat().st_size)
        with campaign.case(f"bit {bit} of {file}"), damaged(path, partial(flip_bit, bit=bit)):
            assert readers.end(name_in_answers(file), asked) == "found"


@pytest.mark.slow
def test_flipped_bits_are_found_by_each_reader(kept, readers, trials):
    campaign = trials("D. flipped bits")
    for kind in KINDS:
        flip(campaign, kept, readers, kind, 2)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_many_flipped_bits_are_found_by_each_reader(kept, readers, trials, kind):
    flip(trials("D. flipped bits"), kept, readers, kind, KINDS[kind][2])


def replace_files(campaign, kept, readers, kinds):
    for kind in kinds:
        file = files_of(kept, kind)[0]
        asked = questions_about(file, kind, readers)
        for change, damage in IN_PLACE.items():
            with campaign.case(f"{change} in place of {file}"), damaged(kept.folder / file, damage):
                if (kind, change) in HARMLESS:
                    assert {answer["status"] for answer in readers.ask(*asked)} <= {0, 1, 2}
                else:
                    assert readers.end(name_in_answers(file), asked) == "found"


@pytest.mark.slow
def test_what_stands_in_place_of_a_file_is_found(kept, readers, trials):
    replace_files(trials("D. lost and replaced files"), kept, readers, ("run", "plan"))


@pytest.mark.slow
def test_what_stands_in_place_of_other_files_is_found(kept, readers, trials):
    others = [kind for kind in KINDS if kind not in {"run", "plan", "kernel"}]
    replace_files(trials("D. lost and replaced files"), kept, readers, others)


@pytest.mark.slow
def test_file_that_vanishes_while_it_is_opened_is_named(kept, readers, trials):
    file = f"{FOLDER}/cubes/sho.h5"
    with trials("D. lost and replaced files").case(file), damaged(kept.folder / file, lambda _: None):
        (answer,) = readers.ask(("vanish", file))
        assert answer["status"] == 2
        assert f"{file} cannot be read. Make it again" in answer["message"]


@pytest.mark.long
def test_damaged_files_of_all_kinds_are_made_again(kept, trials):
    campaign, draw = trials("D. damage that is mended"), random.Random(1)
    places = [path for path in sorted(kept.results.rglob("*")) if path.is_file() and "logs" not in path.parts]
    places = [path for path in places if path.name != "history.jsonl"]
    sound = {path: path.read_bytes() for path in places}
    for _ in range(8):
        chosen = draw.sample(places, 10)
        for path in chosen:
            flip_bit(path, draw.randrange(8 * len(sound[path])))
        done = kept.snakemake(*REMAKE)
        for path in chosen:
            with campaign.case(path):
                assert done.returncode == 0, done.stdout[-2000:]
                assert path.read_bytes() == sound[path]


@pytest.mark.long
def test_flipped_bits_of_compiled_code_change_no_number(kept, readers, trials):
    """The code is compiled again, which takes seconds, so these are fewer cases."""
    campaign, draw, question = trials("D. flipped bits"), random.Random(2), ("integrate", "compiled")
    (kept.folder / "compiled").mkdir(mode=0o700)
    (sound,) = readers.ask(question)
    for path in draw.choices(sorted((kept.folder / "compiled").glob("*.kernel")), k=20):
        bit = draw.randrange(8 * path.stat().st_size)
        with campaign.case(f"bit {bit} of {path.name}"), damaged(path, partial(flip_bit, bit=bit)):
            assert readers.ask(question)[0]["out"] == sound["out"]
