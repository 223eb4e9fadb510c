"""Compiled code on disk: found again without the compiler, made again when it is damaged or when a formula changes."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from hashlib import sha256

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.batch import integrate_batch, kernel_of
from nearharmonic.core import native
from nearharmonic.core.native import cache_folder

OSCILLATOR = nh.systems["sho"]


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
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


def test_one_kernel_is_one_file_and_a_comment_changes_nothing(own_cache):
    worst(OSCILLATOR)
    worst(replace(OSCILLATOR, label="the same formulas"))
    assert len(list(own_cache.iterdir())) == 1


def test_a_changed_formula_is_never_served_old_code(own_cache):
    stiff = replace(OSCILLATOR, V=lambda q: 2 * q[0] * q[0], grad_V=lambda q: (4 * q[0],))
    first, second = worst(OSCILLATOR), worst(stiff)
    assert len(list(own_cache.iterdir())) == 2
    assert second > 10 * first
    assert worst(OSCILLATOR) == first


@pytest.mark.parametrize(
    "damage", [lambda code: code[: len(code) // 2], lambda code: b"", lambda code: code[:-1] + b"x"]
)
def test_a_damaged_file_is_made_again(own_cache, damage):
    first = worst(OSCILLATOR)
    (place,) = own_cache.iterdir()
    place.write_bytes(damage(place.read_bytes()))
    assert worst(OSCILLATOR) == first
    _, digest, code = native._parts(place.read_bytes())
    assert sha256(code).hexdigest() == digest


def test_an_array_of_the_wrong_kind_is_refused_before_the_call(own_cache):
    advance = kernel_of(OSCILLATOR, "double", "compensated").advance()
    with pytest.raises(TypeError, match="contiguous float64 array of 1 dimensions"):
        advance(1, 3, False, np.zeros(32, dtype=np.float32), np.zeros(32), np.zeros(88))


def test_the_cache_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("NEARHARMONIC_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "nearharmonic" / "kernels"


@pytest.mark.parametrize("processor", ["x86-64-v3", "generic"])
def test_code_for_another_processor_computes_the_same_bits(own_cache, monkeypatch, processor):
    here = integrate_batch(OSCILLATOR, nh.integrators["aba864"], t_end=Fraction(50), steps=[170, 90], samples=20)
    monkeypatch.setenv("NUMBA_CPU_NAME", processor)
    for cached in (native.processor, native.core_digest, kernel_of):
        cached.cache_clear()
    there = integrate_batch(OSCILLATOR, nh.integrators["aba864"], t_end=Fraction(50), steps=[170, 90], samples=20)
    for cached in (native.processor, native.core_digest):
        cached.cache_clear()
    assert len(list(own_cache.iterdir())) == 2
    assert np.array_equal(here.q, there.q)
    assert np.array_equal(here.max_energy_error, there.max_energy_error)
