"""Compiled code: its folder, its keys, and functions of numba on disk."""

import importlib
import logging
import os
import pickle
import pwd
import resource
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite import ir

import nearharmonic as nh
from nearharmonic.core import disk, kernel, native
from nearharmonic.core import expression as size
from nearharmonic.core.emission import fingerprint, kinds_of, module_of
from nearharmonic.core.layout import Signature, floats
from nearharmonic.core.numba_code import NumbaFunctionError, compiled_code, jit
from nearharmonic.core.number import FUNCTIONS
from nearharmonic.core.reals import written
from nearharmonic.core.tracing import Rules
from nearharmonic.core.values import Kinds
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import formulas_digest, kernel_of, physics_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import CompiledCodeError
from nearharmonic.math import sqrt
from support.methods.function_arguments import arguments, evaluated, in_double, in_extended, pairs
from support.methods.numba_potentials import walled
from support.methods.own_systems import sites

# --- The folder of compiled code: damaged code is never executed, ownership is checked, and failures never end a


DOT = Signature((floats("factor"), floats("a", "n"), floats("b", "n")), result="float64")
A, B = np.array([1.0, 2.0]), np.array([3.0, 4.0])


def alone(function):
    return kernel.linked_code(written(function, DOT, Kinds(1, 1, 1)))


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
           for i in (*range(header), *range(header, len(good), 13), len(good) - 1)]
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


# --- Functions of numba on disk: reused by a new process, and recompiled after an edit of their dependencies


CALLEE = """
from nearharmonic.core.numba_code import jit

NUMBER = 2.0

@jit
def callee_of_a_test(x):
    return NUMBER * x
"""
CALLER = """
from nearharmonic.core.numba_code import jit
from callee_of_a_test import callee_of_a_test

@jit
def caller_of_a_test(x):
    return callee_of_a_test(x) + 1.0
"""


@pytest.fixture
def folder_of_jit(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(disk, "_WARNED", [])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # of an edit within a second, Python would not notice
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")
    (tmp_path / "caller_of_a_test.py").write_text(CALLER, encoding="utf-8")
    return tmp_path


def loaded_anew():
    """The caller's value at 1, and how often it was found on disk."""
    for name in ("callee_of_a_test", "caller_of_a_test"):
        sys.modules.pop(name, None)
    caller = importlib.import_module("caller_of_a_test").caller_of_a_test
    return caller(1.0), sum(caller.stats.cache_hits.values())


@pytest.mark.slow
@pytest.mark.parametrize("place", [".", "elsewhere"])
def test_an_edit_of_a_callees_constant_compiles_the_caller_again(folder_of_jit, place):
    callee = folder_of_jit / place / "callee_of_a_test.py"
    callee.write_text(CALLEE, encoding="utf-8")
    assert [loaded_anew() for _ in range(2)] == [(3.0, 0), (3.0, 1)]
    callee.write_text(CALLEE.replace("2.0", "3.0"), encoding="utf-8")
    assert loaded_anew() == (4.0, 0)


@pytest.mark.parametrize(("mode", "size"), [(0o777, resource.RLIM_INFINITY), (0o700, 100)])
def test_a_shared_folder_and_a_full_disk_cost_one_warning(folder_of_jit, caplog, mode, size):
    (folder_of_jit / "cache").mkdir()
    (folder_of_jit / "cache").chmod(mode)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        assert [jit(function)(1.0) for function in (lambda x: x + 1, lambda x: x + 2)] == [2.0, 3.0]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [record.getMessage().count("NEARHARMONIC_CACHE_DIR") for record in caplog.records] == [1]
    assert not list(folder_of_jit.rglob("*.nb?"))


# --- Compiled code: reused without the compiler, recompiled after a change of its dependencies, on any processor


OSCILLATOR = nh.systems["sho"]


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    kernel_of.cache_clear()
    yield tmp_path
    kernel_of.cache_clear()


def run(system=OSCILLATOR, **settings):
    """The run as a process finds it that has loaded no kernel yet."""
    kernel_of.cache_clear()
    return integrate_batch(
        system, nh.integrators["ruth"], t_end=Fraction(10), steps=[50], samples=2, numerics=Numerics(**settings)
    )


def kernels_in(folder):
    return list(folder.glob("advance-*.kernel"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "answer"),
    [
        ("sweep('sho', 'ruth', [0.2]).steps.item()", "2500"),
        ("stepper('sho', 'ruth')", "CompiledCodeError: NUMBA_DISABLE_JIT is set, so that numba compiles no step"),
    ],
)
def test_only_steps_for_numba_need_numba(tmp_path, call, answer):
    """A new process: numba reads this variable when it is imported."""
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1", "NEARHARMONIC_CACHE_DIR": str(tmp_path)}
    text = f"import sys, nearharmonic as nh; print(nh.{call}, 'numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", text], env=variables, capture_output=True, text=True, check=False)
    assert f"{answer} False" in done.stdout or answer in done.stderr


def test_a_kernel_is_made_once_and_a_comment_changes_nothing(own_cache):
    run()
    files = set(own_cache.iterdir())
    run(replace(OSCILLATOR, label="the same formulas"))
    assert set(own_cache.iterdir()) == files
    assert len(kernels_in(own_cache)) == 1
    kernel_of(OSCILLATOR, Numerics(precision="extended", width=4))
    assert len(kernels_in(own_cache)) == 2
    # The scheduler of lanes serves all precisions and widths.
    assert len(list(own_cache.glob("run-*.kernel"))) == 1


def test_a_changed_formula_is_never_served_old_code(own_cache):
    """V + 3/2 has the same orbits; H0 = 1/2 becomes 2, so that relative errors become a quarter."""
    raised = replace(OSCILLATOR, V=lambda q: OSCILLATOR.V(q) + Fraction(3, 2))
    stiff = replace(OSCILLATOR, V=lambda q: 2 * q[0] * q[0], grad_V=lambda q: (4 * q[0],))
    first, second, third, again = map(run, (OSCILLATOR, raised, stiff, OSCILLATOR))
    assert len(kernels_in(own_cache)) == 3
    assert (first.energy[0], second.energy[0]) == (0.5, 2)
    assert np.array_equal(second.q, first.q)
    # Both energies are double-double: the ratio is rounded twice, by 2^-53 of itself.
    assert second.max_energy_error[0] == pytest.approx(first.max_energy_error[0] / 4, rel=1e-15)
    assert third.max_energy_error[0] > 10 * first.max_energy_error[0]
    assert again.max_energy_error[0] == first.max_energy_error[0]


@pytest.mark.slow
def test_kernels_of_all_and_of_sampled_energies_share_a_cache(own_cache):
    """Only the first knows the mean over the steps; between two samples the error of an oscillator is larger."""
    kinds = "every", "samples"
    first, second = ({energy: run(energy=energy, look=50) for energy in kinds} for _ in range(2))
    for paths in (first, second):
        assert paths["every"].mean_energy_error[0] > 0
        assert np.isnan(paths["samples"].mean_energy_error[0])
        assert paths["every"].max_energy_error[0] > paths["samples"].max_energy_error[0] > 0


def test_an_energy_seen_in_doubles_alone_gets_its_own_code():
    """For many coordinates, a separate formula first evaluates the energy error at every step in doubles."""
    physics = physics_of(sites(10))
    kept, other = (
        fingerprint(Rules(replace(physics, balanced_T=T), extended=False, compensated=True))
        for T in (physics.balanced_T, lambda p, *parameters: 2 * physics.balanced_T(p, *parameters))
    )
    assert kept != other


def test_an_array_of_the_wrong_kind_is_refused():
    advance = kernel_of(OSCILLATOR).advance
    with pytest.raises(TypeError, match="contiguous float64 array of 1 dimensions"):
        advance(1, 3, False, np.zeros(32, dtype=np.float32), np.zeros(88))


# --- compilers and processors -----------------------------------------------------------------------------------------


def forget():
    """Forget what is known about sources, compiler and processor."""
    for found in (native.core_digest, native.processor, kernel_of):
        found.cache_clear()


@pytest.fixture
def changed(monkeypatch):
    """Variables of the environment, with which code is made by whoever did not know of them."""
    yield monkeypatch
    monkeypatch.undo()
    forget()


def test_another_version_of_the_compiler_has_another_key(changed):
    before = native.code_key()
    forget()
    assert native.code_key() == before
    changed.setattr(native.llvmlite, "__version__", "0.0")
    forget()
    assert native.code_key() != before


def oscillator():
    paths = integrate_batch(OSCILLATOR, nh.integrators["aba864"], t_end=Fraction(50), steps=[170, 90], samples=20)
    return paths.q, paths.max_energy_error


def doubles():
    return [evaluated(in_double(name), arguments(name, 300), 8) for name in FUNCTIONS]


def double_doubles():
    return [evaluated(in_extended(name), pairs(name, 300), 8, 2) for name in FUNCTIONS]


def loops():
    """Fifteen sites, each bound to all others: two blocks of coordinates."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(size, "MOST_UNROLLED", 0)
        made = nh.System(
            name="sites", V=lambda q: -sum(1 / sqrt((x - y) ** 2 + 1) for i, x in enumerate(q) for y in q[:i]),
            q0=[f"{i * i % 7}" for i in range(15)], p0=["0.1"] * 15, t_end="1",
        )  # fmt: skip
        paths = nh.integrate(made, "aba864", 0.1, samples=3)
    return paths.q.values, paths.energy_error.values


def bits(numbers):
    """Bytes of arrays, in which the sign of NaN, which is the processor's, is left out."""
    return [np.where(np.isnan(part), np.nan, part).tobytes() for part in numbers]


@pytest.mark.parametrize(
    ("processor", "computed"),
    [
        *(pytest.param("generic", one, marks=pytest.mark.slow) for one in (oscillator, doubles)),
        *(pytest.param("generic", one, marks=pytest.mark.long) for one in (double_doubles, loops)),
        *(
            pytest.param(name, one, marks=pytest.mark.long)
            for name in ("x86-64-v3", "znver2") for one in (oscillator, doubles, double_doubles, loops)
        ),
    ],
)  # fmt: skip
def test_code_for_another_processor_computes_the_same_bits(own_cache, changed, processor, computed):
    for variable in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):
        changed.delenv(variable, raising=False)
    forget()
    here, before = bits(computed()), len(kernels_in(own_cache))
    changed.setenv("NUMBA_CPU_NAME", processor)
    changed.setenv("NUMBA_CPU_FEATURES", "")
    forget()
    assert bits(computed()) == here
    assert len(kernels_in(own_cache)) == 2 * before


# --- Code of functions of numba: its digest, and what is refused


#: In another order and with other counters.
ELSEWHERE = """
import nearharmonic as nh
from support.methods import numba_potentials
V, grad_V = numba_potentials.walled([1.0, 2.0, 3.0])
V((0.5,))
V, grad_V = numba_potentials.walled([0.5, 0.1, 0.25])
grad_V((1.0,))
from nearharmonic.engine.kernels import formulas_digest
system = nh.System(name="other name", V=V, grad_V=grad_V, q0=1, p0=0, t_end=20)
print(formulas_digest(system), nh.integrate(system, "ruth", 0.01).q.values[-1, 0].hex())
"""


@pytest.fixture(scope="module")
def walls():
    V, grad_V = walled([0.5, 0.1, 0.25])
    return nh.System(name="walled", V=V, grad_V=grad_V, q0=1, p0=0, t_end=20)


@pytest.mark.slow
def test_another_process_finds_the_same_digest_and_orbit(walls):
    here = formulas_digest(walls), nh.integrate(walls, "ruth", 0.01).q.values[-1, 0].hex()
    places = [str(Path(nh.__file__).parents[1]), str(Path(__file__).parents[2])]
    program = f"import sys; sys.path[:0] = {places!r}\n{ELSEWHERE}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.split() == list(here), done.stderr


@pytest.mark.slow
def test_digest_covers_arrays_in_closures_of_functions_that_are_called(walls):
    V, grad_V = walled([0.5, 0.1, 0.25000001])
    assert formulas_digest(walls) != formulas_digest(replace(walls, V=V, grad_V=grad_V))


def test_types_that_numba_knows_leave_digests_alone():
    rules = Rules(physics_of(nh.systems["sho"]), extended=True, compensated=True)
    before = str(module_of(rules, kinds_of(rules, 1), ()))
    ir.global_context.get_identified_type("test.type").set_body(ir.DoubleType())
    assert str(module_of(rules, kinds_of(rules, 1), ())) == before


whole = numba.njit(lambda q: np.sum(q * q) / 2)
both = numba.njit(lambda q: q)
three = numba.njit(lambda q: (1.0, 2.0, 3.0))
misspelt = numba.njit(lambda q: nowhere(q[0]))  # noqa: F821
one_number = numba.njit("float64(float64)")(lambda x: x)
LARGE = np.ones(200_000)
addressed = numba.njit(lambda q: LARGE[int(q[0])] * q[0])


@numba.njit(parallel=True)
def parallel(q):
    total = 0.0
    for i in numba.prange(2):
        total += q[i] ** 2 / 2
    return total


@numba.njit
def printing(q):
    if q[0] < 0:
        print("negative:", q[0])
    return q[0]


@numba.njit
def factorial(n):
    return 1.0 if n <= 1 else n * factorial(n - 1)


recursive = numba.njit(lambda q: factorial(3) * q[0])
REFUSED = {
    "gradient of another length": (whole, three, "grad_V returns UniTuple.*, expected a tuple of 2 real numbers"),
    "gradient that is a number": (whole, whole, r"^V is not compiled .* mul\(UniTuple.*; grad_V returns float64"),
    "value that is an array": (both, both, "^V returns UniTuple.*; V returns array.*, expected one real number"),
    "unknown name": (misspelt, both, "^V is not compiled by numba for a tuple q: NameError: name 'nowhere'"),
    "signature": (one_number, both, "^V is .* for a tuple q: none of its signatures fits; V is .* for an array q"),
    "recursion": (recursive, both, "^V or grad_V calls a function that calls itself: write it as a loop$"),
    "threads": (parallel, both, "^V is compiled with parallel=True"),
    "interpreter": (printing, both, "^V calls the Python interpreter, as print and numba.objmode do: runs cannot$"),
    "address": (addressed, both, "^V refers to an address of this process, by an array of more than a megabyte"),
}  # fmt: skip
#: Cases that take numba half a second.
LONG = {"threads", "interpreter"}


@pytest.mark.slow
@pytest.mark.parametrize("case", [pytest.param(x, marks=[pytest.mark.slow] * (x in LONG)) for x in REFUSED])
def test_functions_that_are_no_potential_are_refused_in_a_sentence(case):
    V, grad_V, message = REFUSED[case]
    with pytest.raises(NumbaFunctionError, match=message):
        compiled_code(V, grad_V, 2, 0)
