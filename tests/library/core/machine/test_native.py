"""Compiled code: reused without the compiler, recompiled after a change of its dependencies, on any processor."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from importlib.metadata import version

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core import expression as size
from nearharmonic.core import kernel, native
from nearharmonic.core.disk import cache_folder
from nearharmonic.core.emission import fingerprint
from nearharmonic.core.number import FUNCTIONS
from nearharmonic.core.tracing import Rules
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of, physics_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.math import sqrt
from support.methods.function_arguments import arguments, evaluated, in_double, in_extended, pairs
from support.methods.own_systems import sites

OSCILLATOR = nh.systems["sho"]


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    for path in cache_folder().glob("loops-*.kernel"):  # numba takes most of the time for these
        shutil.copy2(path, tmp_path)
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
def test_a_numba_that_must_not_compile_is_one_clear_error(tmp_path):
    """A new process: numba reads this variable when it is imported, too."""
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1", "NEARHARMONIC_CACHE_DIR": str(tmp_path)}
    text = "import nearharmonic as nh; nh.sweep('sho', 'ruth', [0.2])"
    done = subprocess.run([sys.executable, "-c", text], env=variables, capture_output=True, text=True, check=False)
    assert "CompiledCodeError: NUMBA_DISABLE_JIT is set, so that kernels cannot be compiled: unset it" in done.stderr


@pytest.mark.slow
def test_loops_are_compiled_once_where_nothing_can_be_kept(monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", "/proc/nearharmonic")  # read-only for root too
    monkeypatch.setattr(kernel, "_MADE", {})
    made, compiled = [], kernel.compiled_loops
    monkeypatch.setattr(kernel, "compiled_loops", lambda *given: made.append(given[0].__name__) or compiled(*given))
    for system in ("sho", "henon_heiles"):
        run(nh.systems[system])
    assert sorted(made) == ["advance", "begin", "run"]


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
    """Forget what is known about sources, compilers and processor."""
    for found in (native._source_digest, native.core_digest, native.processor, kernel_of):
        found.cache_clear()


@pytest.fixture
def changed(monkeypatch):
    """Variables of the environment, with which code is made by whoever did not know of them."""
    yield monkeypatch
    monkeypatch.undo()
    forget()


@pytest.mark.parametrize("compiler", ["numba", "llvmlite"])
def test_another_version_of_a_compiler_has_another_key(changed, compiler):
    before = native.code_key()
    forget()
    assert native.code_key() == before
    changed.setattr(native, "version", lambda name: "0.0" if name == compiler else version(name))
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
