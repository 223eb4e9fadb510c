"""The folder of compiled code: damage is never executed, trust is checked, and nothing that fails there ends a run."""

from __future__ import annotations

import logging
import os
import pickle
import platform
import pwd
import resource
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core import disk, link, native
from nearharmonic.core.layout import Signature, floats
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import CompiledCodeError

DOT = Signature((floats("factor"), floats("a", "n"), floats("b", "n")), result="float64")
A, B = np.array([1.0, 2.0]), np.array([3.0, 4.0])


def weighted(weight):
    """Symbol and object code of a function of ``DOT``: factor a.b, times ``weight``."""

    def dot(factor, a, b):
        return weight * factor * (a[0] * b[0] + a[1] * b[1])

    return link.alone(*link.loops(dot, DOT))


@pytest.fixture(scope="module")
def right():
    return weighted(1.0)


@pytest.fixture(scope="module")
def planted():
    return weighted(2.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NEARHARMONIC_SHARED_CACHE", raising=False)
    monkeypatch.setattr(disk, "_WARNED", [])
    return tmp_path


def value(code, key="dot"):
    return native.native(key, DOT, lambda: code)(0.5, A, B)


def warnings_of(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def refused():
    raise AssertionError("compiled again")


FUZZ = """
import pickle, sys
from pathlib import Path
import numpy as np
from nearharmonic.core import native
signature, code, place = pickle.loads(Path(sys.argv[1]).read_bytes())
good = place.read_bytes()
header = good.index(code[1])
damaged = [good[:i] + bytes([good[i] ^ 1 << i % 8]) + good[i + 1:]
           for i in (*range(header), *range(header, len(good), 17), len(good) - 1)]
damaged += [good[:n] for n in (*range(0, header, 5), *range(header, len(good), 41), len(good) - 1)]
damaged += [good + b"x", b"\\n" * 200, code[1]]
for content in damaged:
    place.write_bytes(content)
    made = []
    function = native.native("dot", signature, lambda: made.append(1) or code)
    result = function(0.5, np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    assert (result, made) == (5.5, [1]), (content[:header], result, made)
    assert place.read_bytes() == good
print(len(damaged), "numba" in sys.modules)
"""


def test_no_flipped_bit_and_no_truncation_crashes_or_gives_a_wrong_number(folder, right):
    value(right)
    (place,) = folder.iterdir()
    (folder / "task").write_bytes(pickle.dumps((DOT, right, place)))
    done = subprocess.run(
        [sys.executable, "-c", FUZZ, str(folder / "task")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    count, compiler = done.stdout.split()
    assert int(count) > 150
    assert compiler == "False"


LOAD = """
import pickle, sys
from pathlib import Path
import numpy as np
from nearharmonic.core import native
signature, code = pickle.loads(Path(sys.argv[1]).read_bytes())
print(native.native("dot", signature, lambda: code)(0.5, np.array([1.0, 2.0]), np.array([3.0, 4.0])))
"""


@pytest.mark.parametrize(("name", "content"), [("no_such_symbol", None), (None, b""), (None, b"no object file")])
def test_what_cannot_be_loaded_is_made_again_although_its_digest_is_right(folder, right, name, content):
    """In a process of its own: a call of address 0, or a bad object file, would end this one."""
    place = folder / "dot.kernel"
    disk.write(place, right[0] if name is None else name, right[1] if content is None else content)
    (folder / "task").write_bytes(pickle.dumps((DOT, right)))
    command = [sys.executable, "-c", LOAD, str(folder / "task")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "5.5\n"), done.stderr
    assert disk.read(place) == right


def test_code_that_cannot_be_loaded_when_just_made_is_one_clear_error_and_is_not_kept(folder, right):
    with pytest.raises(CompiledCodeError, match="no symbol 'no_such_symbol'"):
        value(("no_such_symbol", right[1]))
    with pytest.raises(CompiledCodeError, match="no object file of 14 bytes"):
        value((right[0], b"no object file"))
    assert not list(folder.iterdir())


def test_a_fault_of_compiled_code_is_not_blamed_on_the_systems_formulas(folder, monkeypatch):
    monkeypatch.setattr(link, "linked", lambda *_: ("entry", b"no object file"))
    kernel_of.cache_clear()
    with pytest.raises(CompiledCodeError, match="no object file"):
        kernel_of(nh.systems["sho"], Numerics(width=2))


def test_a_file_under_the_name_of_another_key_is_not_executed(folder, right, planted):
    value(planted, "other")
    (folder / "other.kernel").rename(folder / "dot.kernel")
    assert value(right) == 5.5


def occupied(folder, monkeypatch):
    (folder / "file").write_text("")
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(folder / "file"))


def below_a_file(folder, monkeypatch):
    (folder / "file").write_text("")
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(folder / "file" / "deep"))


def read_only(folder, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", "/proc/nearharmonic")  # read-only for root too


def homeless(folder, monkeypatch):
    def getpwuid(uid):
        raise KeyError(uid)

    for name in ("NEARHARMONIC_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", getpwuid)


def unknown_user(folder, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", "~no_such_user/kernels")


@pytest.mark.parametrize("obstacle", [occupied, below_a_file, read_only, homeless, unknown_user])
def test_a_cache_that_cannot_be_made_costs_one_warning(folder, monkeypatch, caplog, right, obstacle):
    obstacle(folder, monkeypatch)
    assert [value(right, key) for key in ("dot", "again")] == [5.5, 5.5]
    (warning,) = warnings_of(caplog)
    assert "NEARHARMONIC_CACHE_DIR" in warning


def test_a_full_disk_costs_one_warning_and_leaves_nothing_behind(folder, caplog, right):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        assert [value(right, key) for key in ("dot", "again")] == [5.5, 5.5]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    (warning,) = warnings_of(caplog)
    assert "NEARHARMONIC_CACHE_DIR" in warning
    assert not list(folder.iterdir())


def test_a_run_goes_on_without_a_cache_even_where_warnings_are_errors(folder, right):
    (folder / "task").write_bytes(pickle.dumps((DOT, right)))
    environment = os.environ | {"NEARHARMONIC_CACHE_DIR": str(folder / "task" / "deep")}
    command = [sys.executable, "-W", "error", "-c", LOAD, str(folder / "task")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "5.5\n"
    assert done.stderr.count("NEARHARMONIC_CACHE_DIR") == 1


def test_temporary_names_carry_host_and_process(folder, monkeypatch, right):
    names, replace = [], Path.replace
    monkeypatch.setattr(Path, "replace", lambda part, place: names.append(part.name) or replace(part, place))
    value(right)
    assert platform.node() in names[0]
    assert f".{os.getpid()}." in names[0]
    assert names[0].endswith(".part")


def open_to_the_group(folder, monkeypatch):
    folder.chmod(0o770)


def open_to_all(folder, monkeypatch):
    folder.chmod(0o707)


def of_another_user(folder, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)


@pytest.mark.parametrize("access", [open_to_the_group, open_to_all, of_another_user])
def test_a_folder_that_others_can_change_is_not_executed_from(folder, monkeypatch, caplog, right, planted, access):
    value(planted)
    access(folder, monkeypatch)
    assert value(right) == 5.5
    (warning,) = warnings_of(caplog)
    assert "NEARHARMONIC_CACHE_DIR" in warning
    assert "NEARHARMONIC_SHARED_CACHE=1" in warning


@pytest.mark.parametrize("access", [open_to_the_group, open_to_all, of_another_user])
def test_a_shared_folder_is_used_where_it_is_asked_for(folder, monkeypatch, caplog, planted, access):
    access(folder, monkeypatch)
    monkeypatch.setenv("NEARHARMONIC_SHARED_CACHE", "1")
    value(planted)
    assert stat.S_IMODE((folder / "dot.kernel").stat().st_mode) == 0o644
    assert native.native("dot", DOT, refused)(0.5, A, B) == 11.0
    assert not warnings_of(caplog)


def test_a_file_that_others_can_change_is_not_executed(folder, right, planted):
    value(planted)
    (folder / "dot.kernel").chmod(0o666)
    assert value(right) == 5.5
    assert native.native("dot", DOT, refused)(0.5, A, B) == 5.5


def test_a_folder_that_others_can_only_read_is_used(folder, caplog, right):
    folder.chmod(0o755)
    value(right)
    assert native.native("dot", DOT, refused)(0.5, A, B) == 5.5
    assert not warnings_of(caplog)


def test_folders_and_files_are_made_for_their_owner_alone(folder, monkeypatch, right):
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", "~/one/two")
    before = os.umask(0)
    try:
        value(right)
    finally:
        os.umask(before)
    made = [folder / "one", folder / "one" / "two", folder / "one" / "two" / "dot.kernel"]
    assert [stat.S_IMODE(path.stat().st_mode) for path in made] == [0o700, 0o700, 0o600]


def test_the_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("NEARHARMONIC_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert disk.cache_folder() == tmp_path / "nearharmonic" / "kernels"


def test_two_functions_of_one_name_stay_apart(right, planted):
    functions = [native.loaded(*code, DOT) for code in (right, planted)]
    assert [function(0.5, A, B) for function in functions] == [5.5, 11.0]
