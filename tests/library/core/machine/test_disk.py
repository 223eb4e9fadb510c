"""The folder of compiled code: damaged code is never executed, ownership is checked, and failures never end a run."""

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
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from llvmlite import ir

import nearharmonic as nh
from nearharmonic.core import disk, kernel, native
from nearharmonic.core.layout import Signature, floats
from nearharmonic.core.values import Kinds
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import CompiledCodeError

DOT = Signature((floats("factor"), floats("a", "n"), floats("b", "n")), result="float64")
A, B = np.array([1.0, 2.0]), np.array([3.0, 4.0])


def alone(function):
    return kernel.linked_code(*kernel.compiled_loops(function, DOT), ir.Module(), Kinds(1, 1, 1))


@pytest.fixture(scope="module")
def right():
    """Symbol and object code of a function of ``DOT``: factor a.b."""
    return alone(lambda factor, a, b: factor * (a[0] * b[0] + a[1] * b[1]))


@pytest.fixture(scope="module")
def planted():
    """Function with the name of another one and twice its value."""
    return alone(lambda factor, a, b: 2 * factor * (a[0] * b[0] + a[1] * b[1]))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NEARHARMONIC_SHARED_CACHE", raising=False)
    monkeypatch.setattr(disk, "_WARNED", [])
    return tmp_path


def value(code, key="dot"):
    return native.native(key, DOT, lambda: code)(0.5, A, B)


def kept(key="dot"):
    """The value of code that is not compiled again."""
    return native.native(key, DOT, lambda: pytest.fail("compiled again"))(0.5, A, B)


def warnings_of(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def in_another_process(folder, text, *given):
    """A process that executes ``text`` with the path of a file that holds what is given."""
    (folder / "task").write_bytes(pickle.dumps(given))
    command = [sys.executable, "-c", text, str(folder / "task")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


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


@pytest.mark.slow
def test_no_flipped_bit_or_truncation_gives_wrong_number(folder, right):
    value(right)
    (place,) = folder.iterdir()
    done = in_another_process(folder, FUZZ, DOT, right, place)
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


@pytest.mark.slow
@pytest.mark.parametrize(("name", "content"), [("no_such_symbol", None), (None, b""), (None, b"no object file")])
def test_unloadable_code_with_right_digest_is_made_again(folder, right, name, content):
    """In a process of its own: a call of address 0, or a bad object file, would end this one."""
    place = folder / "dot.kernel"
    disk.write(place, right[0] if name is None else name, right[1] if content is None else content)
    done = in_another_process(folder, LOAD, DOT, right)
    assert (done.returncode, done.stdout) == (0, "5.5\n"), done.stderr
    assert disk.read(place) == right


def test_new_code_that_fails_to_load_is_one_error(folder, right):
    with pytest.raises(CompiledCodeError, match="no symbol 'no_such_symbol'"):
        value(("no_such_symbol", right[1]))
    with pytest.raises(CompiledCodeError, match="no object file of 14 bytes"):
        value((right[0], b"no object file"))
    assert not list(folder.iterdir())


@pytest.mark.slow
def test_fault_of_compiled_code_is_not_blamed_on_systems_formulas(folder, monkeypatch):
    monkeypatch.setattr(kernel, "linked_code", lambda *_: ("entry", b"no object file"))
    kernel_of.cache_clear()
    with pytest.raises(CompiledCodeError, match="no object file"):
        kernel_of(nh.systems["sho"], Numerics(width=2))


def test_code_that_many_want_at_once_is_compiled_once(folder, right):
    made = []

    def make():
        made.append(right)
        time.sleep(0.2)
        return right

    with ThreadPoolExecutor(4) as pool:
        values = [*pool.map(lambda _: native.native("dot", DOT, make)(0.5, A, B), range(4))]
    assert (values, made) == ([5.5] * 4, [right])
    assert [path.name for path in folder.iterdir()] == ["dot.kernel"]


def test_a_killed_process_leaves_its_claim_to_the_next(folder, right):
    claim = "from pathlib import Path; from nearharmonic.core import disk\n"
    claim += f"with disk.claimed(Path({str(folder / 'dot.kernel')!r})): print('claimed', flush=True); input()"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", claim], **pipes) as other:
        other.stdout.readline()
        assert (folder / "dot.lock").exists()
        other.kill()
    assert value(right) == 5.5
    assert not (folder / "dot.lock").exists()


def test_who_waits_too_long_compiles_itself(folder, monkeypatch, right):
    monkeypatch.setattr(disk, "PATIENCE", 0.1)
    with disk.claimed(folder / "dot.kernel"):
        assert value(right) == 5.5


def test_file_under_name_of_another_key_is_not_executed(folder, right, planted):
    value(planted, "other")
    (folder / "other.kernel").rename(folder / "dot.kernel")
    assert value(right) == 5.5


@pytest.mark.parametrize("place", ["{}/file", "{}/file/deep", "/proc/nearharmonic", "~no_such_user/kernels", None])
def test_a_cache_that_cannot_be_made_costs_one_warning(folder, monkeypatch, caplog, right, place):
    """A file in its place, a file above it, what is read-only for root too, an unknown user, and nobody's home."""
    (folder / "file").write_text("")
    if place is None:
        for name in ("NEARHARMONIC_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    else:
        monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", place.format(folder))
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


def test_temporary_names_carry_host_and_process(folder, monkeypatch, right):
    names, replace = [], Path.replace
    monkeypatch.setattr(Path, "replace", lambda part, place: names.append(part.name) or replace(part, place))
    value(right)
    assert platform.node() in names[0]
    assert f".{os.getpid()}." in names[0]
    assert names[0].endswith(".part")


@pytest.mark.parametrize("mode", [0o770, 0o707, None])
def test_code_in_a_shared_folder_is_executed_only_on_request(folder, monkeypatch, caplog, right, planted, mode):
    """Folders that the group or all can change, and one of another user."""
    value(planted)
    if mode is None:
        monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    else:
        folder.chmod(mode)
    assert value(right) == 5.5
    (warning,) = warnings_of(caplog)
    assert "NEARHARMONIC_CACHE_DIR" in warning
    assert "NEARHARMONIC_SHARED_CACHE=1" in warning
    monkeypatch.setenv("NEARHARMONIC_SHARED_CACHE", "1")
    caplog.clear()
    assert kept() == 11.0
    value(planted, "other")
    assert stat.S_IMODE((folder / "other.kernel").stat().st_mode) == 0o644
    assert kept("other") == 11.0
    assert not warnings_of(caplog)


def test_a_file_that_others_can_change_is_not_executed(folder, right, planted):
    value(planted)
    (folder / "dot.kernel").chmod(0o666)
    assert value(right) == 5.5
    assert kept() == 5.5


def test_a_folder_that_others_can_only_read_is_used(folder, caplog, right):
    folder.chmod(0o755)
    value(right)
    assert kept() == 5.5
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
