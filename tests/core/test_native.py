"""Compiled code: found again without the compiler, and made again when what it depends on changes."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from importlib.metadata import version

import numpy as np
import pytest

import nearharmonic as nh
from kept_loops import keep_loops
from nearharmonic.core import native
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics

OSCILLATOR = nh.systems["sho"]


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    keep_loops(tmp_path)
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path))
    kernel_of.cache_clear()
    yield tmp_path
    kernel_of.cache_clear()


def worst(system):
    kernel_of.cache_clear()
    paths = integrate_batch(system, nh.integrators["ruth"], t_end=Fraction(10), steps=[50], samples=2)
    return paths.max_energy_error[0]


def test_a_second_process_finds_the_kernel_and_does_not_load_the_compiler(own_cache):
    worst(OSCILLATOR)
    text = "import sys, nearharmonic as nh; print(nh.sweep('sho', 'ruth', [0.2]).steps.item(), 'numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["2500", "False"]


def forget(module):
    """What the module has found out about sources, compilers and processor."""
    for found in (module._source_digest, module.core_digest, module.processor):
        found.cache_clear()


def kernels_in(folder):
    return list(folder.glob("advance-*.kernel"))


def test_a_kernel_is_made_once_and_a_comment_changes_nothing(own_cache):
    worst(OSCILLATOR)
    files = set(own_cache.iterdir())
    worst(replace(OSCILLATOR, label="the same formulas"))
    assert set(own_cache.iterdir()) == files
    assert len(kernels_in(own_cache)) == 1


def test_the_scheduler_of_lanes_is_compiled_once_for_all_precisions_and_widths(own_cache):
    worst(OSCILLATOR)
    kernel_of(OSCILLATOR, Numerics(precision="extended", width=4))
    assert len(kernels_in(own_cache)) == 2
    assert len(list(own_cache.glob("run-*.kernel"))) == 1


def test_a_changed_formula_is_never_served_old_code(own_cache):
    stiff = replace(OSCILLATOR, V=lambda q: 2 * q[0] * q[0], grad_V=lambda q: (4 * q[0],))
    first, second = worst(OSCILLATOR), worst(stiff)
    assert len(kernels_in(own_cache)) == 2
    assert second > 10 * first
    assert worst(OSCILLATOR) == first


def test_an_array_of_the_wrong_kind_is_refused_before_the_call(own_cache):
    advance = kernel_of(OSCILLATOR).advance()
    with pytest.raises(TypeError, match="contiguous float64 array of 1 dimensions"):
        advance(1, 3, False, np.zeros(32, dtype=np.float32), np.zeros(88))


@pytest.mark.parametrize("compiler", ["numba", "llvmlite"])
def test_another_version_of_a_compiler_has_another_key(monkeypatch, compiler):
    before = native.code_key()
    monkeypatch.setattr(native, "version", lambda name: "0.0" if name == compiler else version(name))
    forget(native)
    after = native.code_key()
    forget(native)
    assert after != before


def on_processor(monkeypatch, name):
    """A run by code made for the processor of this name, or for the host if it is None, whatever is set outside."""
    for variable in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):
        monkeypatch.delenv(variable, raising=False)
    if name is not None:
        monkeypatch.setenv("NUMBA_CPU_NAME", name)
    forget(native)
    kernel_of.cache_clear()
    run = integrate_batch(OSCILLATOR, nh.integrators["aba864"], t_end=Fraction(50), steps=[170, 90], samples=20)
    forget(native)
    kernel_of.cache_clear()
    return run


@pytest.mark.parametrize("processor", ["x86-64-v3", "generic"])
def test_code_for_another_processor_computes_the_same_bits(own_cache, monkeypatch, processor):
    here, there = on_processor(monkeypatch, None), on_processor(monkeypatch, processor)
    assert len(kernels_in(own_cache)) == 2
    assert np.array_equal(here.q, there.q)
    assert np.array_equal(here.max_energy_error, there.max_energy_error)
