"""Files: whole at every moment, and what is no regular file is one error at once."""

import os
import platform
import signal
import stat
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from nearharmonic.errors import FileWriteError, ResultFileError
from nearharmonic.output import store
from nearharmonic.output.atomic import parts_in, read_bytes, read_text, remove_parts, replacing, write_text
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.manifest import Texts


def names(folder):
    return [path.name for path in folder.iterdir()]


def stopped(place, stop):
    with replacing(place) as part:
        part.write_text("half of the n")
        raise stop


def test_the_old_content_stays_until_the_new_one_is_complete(tmp_path):
    place = tmp_path / "table.csv"
    place.write_text("old")
    with replacing(place) as part:
        part.write_text("new")
        assert place.read_text() == "old"
    assert place.read_text() == "new"
    assert names(tmp_path) == ["table.csv"]


@pytest.mark.parametrize("stop", [OSError("disk full"), KeyboardInterrupt(), SystemExit(1)])
def test_block_that_raises_leaves_old_content_and_nothing_else(tmp_path, stop):
    place = tmp_path / "table.csv"
    place.write_text("old")
    with pytest.raises(type(stop)):
        stopped(place, stop)
    assert place.read_text() == "old"
    assert names(tmp_path) == ["table.csv"]


def test_the_folder_is_made_and_text_is_utf_8(tmp_path):
    place = tmp_path / "results" / "tables" / "table.md"
    write_text(place, "τ, Hénon\n")
    assert place.read_bytes() == b"\xcf\x84, H\xc3\xa9non\n"


def test_processes_on_all_machines_write_to_different_names(tmp_path, monkeypatch):
    parts = set()
    for host in ("first", "second"):
        for process in (17, 170):
            monkeypatch.setattr(platform, "node", lambda host=host: host)
            monkeypatch.setattr(os, "getpid", lambda process=process: process)
            for place in (tmp_path / "fig1.pdf", tmp_path / "fig1.png"):
                with replacing(place) as part:
                    part.touch()
                assert part.parent == place.parent  # a move from another file system would be a copy
                assert part.name.startswith(".")
                parts.add(part)
    assert len(parts) == 2 * 2 * 2


def test_killed_process_leaves_old_content_and_hidden_file(tmp_path):
    place = tmp_path / "table.csv"
    place.write_text("old")
    killed = (
        "import os, signal, sys\n"
        "from nearharmonic.output.atomic import replacing\n"
        "with replacing(sys.argv[1]) as part:\n"
        "    part.write_text('half of the n')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", killed, place], check=False)
    assert done.returncode == -signal.SIGKILL
    assert place.read_text() == "old"
    (left,) = [name for name in names(tmp_path) if name != "table.csv"]
    assert left.startswith(".table.csv.")
    assert left.endswith(".part")
    write_text(place, "new")
    assert place.read_text() == "new"


def test_bytes_are_on_disk_before_the_name(tmp_path, monkeypatch):
    done = []

    def noted(number):
        done.append("folder" if stat.S_ISDIR(os.fstat(number).st_mode) else os.fstat(number).st_size)
        return synchronise(number)

    synchronise, move = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", noted)
    monkeypatch.setattr(Path, "replace", lambda part, place: done.append("move") or move(part, place))
    write_text(tmp_path / "table.csv", "seven b")
    assert done == [7, "move", "folder"]


def test_writing_that_fails_is_one_sentence_with_file_and_reason(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    no_folder = tmp_path / "file/table.csv"
    with pytest.raises(FileWriteError, match=r"/file/table\.csv cannot be written: .*(Not a directory|File exists)"):
        write_text(no_folder, "new")
    with pytest.raises(FileWriteError, match=r"/folder cannot be written: .*Is a directory"):
        write_text(tmp_path / "folder", "new")
    monkeypatch.setattr(os, "fsync", lambda _: os.open(tmp_path / "missing", os.O_RDONLY))
    with pytest.raises(FileWriteError, match=r"/table\.csv cannot be written: .*No such file or directory: .*missing"):
        write_text(tmp_path / "table.csv", "new")
    assert sorted(names(tmp_path)) == ["file", "folder"]


def test_temporary_files_of_ended_processes_are_removed(tmp_path):
    here, elsewhere = (tmp_path / f"figures/.a.svg.{host}.7.part" for host in (platform.node(), "elsewhere"))
    here.parent.mkdir()
    kept = tmp_path / "figures/mine.part"
    for place in (here, elsewhere, kept):
        place.write_bytes(b"half")
    assert parts_in(tmp_path) == sorted([here, elsewhere])
    remove_parts(tmp_path)
    assert sorted(tmp_path.rglob("*.part")) == sorted([elsewhere, kept])
    os.utime(elsewhere, (1, 1))
    remove_parts(tmp_path)
    assert list(tmp_path.rglob("*.part")) == [kept]


NO_FILES = {
    "pipe": os.mkfifo, "folder": os.mkdir, "endless device": lambda place: place.symlink_to("/dev/zero"),
    "link to itself": lambda place: place.symlink_to(place),
}  # fmt: skip


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_regular_file_is_an_error_at_once(tmp_path, kind):
    place = tmp_path / "place"
    NO_FILES[kind](place)
    with pytest.raises(OSError, match=r"not a regular file|Too many levels of symbolic links"):
        read_bytes(place)


@pytest.mark.parametrize("kind", NO_FILES)
def test_readers_of_results_name_it_in_a_sentence(tmp_path, kind):
    for name in ("manifest.json", "cubes.h5", "table.csv"):
        NO_FILES[kind](tmp_path / name)
    for read in (
        lambda: manifest.read(tmp_path),
        lambda: store.read(tmp_path / "cubes.h5"),
        lambda: Texts(tmp_path).table("table.csv"),
    ):
        with pytest.raises(ResultFileError, match="Make it again: snakemake"):
            read()


def test_regular_file_is_read_and_file_descriptors_are_closed(tmp_path):
    (tmp_path / "a").write_bytes(b"\xc3\xa9\xff")
    os.mkfifo(tmp_path / "pipe")
    before = len(list(Path("/dev/fd").iterdir()))
    for _ in range(5):
        assert read_text(tmp_path / "a", "replace") == "é\ufffd"
        with suppress(OSError):
            read_bytes(tmp_path / "pipe")
    with pytest.raises(UnicodeDecodeError):
        read_text(tmp_path / "a")
    assert len(list(Path("/dev/fd").iterdir())) == before
