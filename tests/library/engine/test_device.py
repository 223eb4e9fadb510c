"""Runs on a GPU: the bits of a processor, chunks that fit the memory, and one sentence where there is no GPU.

The driver is a recorded one, whose threads run the kernel compiled for the processor. What a GPU runs is PTX text,
which is read and assembled here. Bits of a real GPU are compared by ``benchmarks/gpu.py``.
"""

import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core.gpu import MemberKernel, build_member
from nearharmonic.engine import device
from nearharmonic.engine.kernels import physics_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import MissingPackageError, SettingError
from support.methods.numba_potentials import springs
from support.methods.own_systems import sites, spring
from support.recorded_driver import RecordedDriver

RNG = np.random.default_rng(51)
#: Members of which some leave their energy surface.
NEAR, FAR = RNG.normal(0, 0.12, (300, 2)), RNG.normal(0, 0.35, (300, 2))
PLANETS = np.array([69.8, 0.0]) * RNG.uniform(0.7, 1.4, (300, 1))
MASSES = np.linspace(1.5, 2, 300)
CASES = {
    "compensated": ("henon_heiles", "babps8o7h", 1.0, {"q0": FAR}),
    "plain": ("henon_heiles", "ruth", 0.25, {"q0": NEAR, "summation": "plain"}),
    "double-double": ("henon_heiles", "abas5o6h", 0.5, {"q0": NEAR, "precision": "extended"}),
    "samples": ("kepler", "babps9o7h", 80.0, {"q0": PLANETS, "t_end": 3200, "samples": 5}),
    "times": ("kepler", "aba864", 60.0, {"q0": PLANETS, "t": [0, 100, 1000, 2500]}),
    "energy at samples": ("henon_heiles", "babs7o7h", 1.0, {"q0": FAR, "energy": "samples", "samples": 9}),
    "no energy": ("sho", "aba1064", 1.0, {"q0": NEAR[:, :1], "energy": "none"}),
    "modified potential": ("henon_heiles", "chin_4a", 0.5, {"q0": NEAR}),
    "processed": ("henon_heiles", "rowlands", 0.5, {"q0": FAR, "samples": 4}),
    "parameters": ("kepler", "ruth", 30.0, {"q0": PLANETS, "t_end": 900, "parameters": {"GM": MASSES}}),
    "backwards": ("henon_heiles", "babps9o7h", 0.8, {"q0": NEAR, "t_end": -32}),
}  # fmt: skip


@pytest.fixture
def driver(monkeypatch):
    """A recorded driver in place of a GPU's driver; kernels stand for the text that they would send."""

    def install(**given):
        found = RecordedDriver(**given)

        def text(kernel):
            name = f"kernel {id(kernel)}"
            if name not in found.kernels:
                found.kernels[name] = kernel.native()
            return name

        monkeypatch.setattr(MemberKernel, "ptx", property(text))
        bindings = SimpleNamespace(driver=found)
        for name in ("cuda", "cuda.bindings"):
            monkeypatch.setitem(sys.modules, name, bindings)
        device.gpu.cache_clear()
        return found

    yield install
    device.gpu.cache_clear()


@pytest.mark.parametrize("case", CASES)
def test_a_gpu_returns_the_bits_of_a_processor(driver, monkeypatch, case):
    system, method, tau, given = CASES[case]
    given = {"t_end": 30} | given if "t" not in given else given
    monkeypatch.setattr(device, "FIRST", 7)  # a run takes several launches
    recorded = driver(free=600_000)
    processor, gpu = (nh.ensemble(system, method, tau, device=where, **given) for where in ("cpu", "gpu"))
    assert processor.identical(gpu)
    assert len(recorded.named("cuLaunchKernel")) >= 2


def test_some_members_diverge_on_both(driver):
    driver()
    system, method, tau, given = CASES["compensated"]
    left = nh.ensemble(system, method, tau, t_end=30, device="gpu", **given).diverged_at.values
    assert 0 < np.count_nonzero(left) < len(FAR)


def test_a_section_on_a_gpu_is_that_of_a_processor(driver):
    recorded = driver()
    starts = np.array([[0.0, 0.1, 0.4, 0.05], [0.0, -0.1, 0.45, 0.1]])
    given = {"surface": 0, "starts": starts, "t_end": 60}
    processor, gpu = (nh.section("henon_heiles", "babps8o7h", 0.4, device=where, **given) for where in ("cpu", "gpu"))
    assert processor.identical(gpu)
    assert recorded.named("cuLaunchKernel")


def test_chunks_fit_the_free_memory_and_everything_is_freed(driver):
    recorded = driver(free=400_000)
    nh.ensemble("henon_heiles", "ruth", 0.5, q0=NEAR, t_end=10, device="gpu")
    assert sum(size for (size,) in recorded.named("cuMemAlloc")) < 400_000
    assert len(recorded.named("cuStreamCreate")) == 2
    assert not recorded.memory
    assert not recorded.streams


def test_results_of_a_chunk_come_while_the_next_one_runs(driver):
    recorded = driver(free=400_000)
    nh.ensemble("henon_heiles", "ruth", 0.5, q0=NEAR, t_end=10, device="gpu")
    order = [name for name, _ in recorded.calls if name in ("cuLaunchKernel", "cuMemcpyDtoHAsync")]
    streams = [given[8] for given in recorded.named("cuLaunchKernel")]
    assert order.index("cuMemcpyDtoHAsync") < len(order) - 1 - order[::-1].index("cuLaunchKernel")
    assert {len(set(pair)) for pair in pairwise(streams)} == {2}


def test_ctrl_c_ends_a_long_run_within_a_second(driver):
    recorded = driver()
    threading.Timer(1.0, lambda: signal.raise_signal(signal.SIGINT)).start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        nh.ensemble("henon_heiles", "babps8o7h", 0.001, q0=NEAR[:20] / 4, t_end=10**5, device="gpu")
    assert time.monotonic() - begin < 1.0 + 10 * device.LAUNCH  # launches of a processor that others use too
    assert not recorded.memory


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"devices": 0}, r"needs a GPU of NVIDIA of compute capability 7\.0 or later.*CUDA_ERROR_NO_DEVICE"),
        ({"major": 5}, r"recorded has 5\.0"),
        ({"free": 1000}, r"bytes of free memory; the GPU has 1\.0e\+03"),
    ],
)
def test_a_missing_old_or_small_gpu_is_one_sentence(driver, given, says):
    driver(**given)
    with pytest.raises(SettingError, match=says):
        nh.ensemble("sho", "ruth", 0.1, q0=[[1.0]] * 200, t_end=1, device="gpu")


@pytest.mark.skipif(find_spec("cuda") is not None, reason="the extra gpu is installed")
def test_the_missing_package_is_named():
    device.gpu.cache_clear()
    with pytest.raises(MissingPackageError, match=r"cuda-bindings: pip install 'nearharmonic\[gpu\]'"):
        nh.ensemble("sho", "ruth", 0.1, q0=[[1.0]], t_end=1, device="gpu")


@pytest.mark.parametrize(
    ("system", "method", "given", "says"),
    [
        ("sho", "gauss16", {}, "an implicit method"),
        ("henon_heiles", "ruth", {"split": "exact_oscillator"}, "an oscillator that is solved exactly"),
        ("kepler_regularised", "ruth", {"t_end": 100}, "a regularised system"),
        (lambda: sites(200), "ruth", {}, "many coordinates"),
        (springs, "ruth", {}, "a potential that numba compiles"),
    ],
)
def test_a_form_that_no_gpu_computes_is_an_error(driver, system, method, given, says):
    driver()
    subject = system if isinstance(system, str) else system()
    with pytest.raises(SettingError, match=says):
        nh.ensemble(subject, method, 0.5, device="gpu", **given)


def test_auto_takes_a_gpu_only_where_it_is_faster(driver):
    many, method = {"runs": device.RUNS, "steps": device.EVALUATIONS}, nh.integrators["ruth"]
    expected = {(2, True): "gpu", (2, False): "cpu", (32, True): "cpu"}
    found = {}
    for ratio, large in expected:
        driver(ratio=ratio)
        sizes = many if large else {"runs": 10, "steps": 1000}
        found[ratio, large] = device.device_of("auto", nh.systems["sho"], method, Numerics(), **sizes)
    assert found == expected


# --- The text for a GPU.

ARITHMETIC = {
    "plain": {"extended": False, "compensated": False},
    "compensated": {"extended": False, "compensated": True},
    "double-double": {"extended": True, "compensated": True},
}
KERNELS = {
    f"{system} {how}": (nh.systems[system], how, {})
    for system in ("sho", "henon_heiles", "kepler") for how in ARITHMETIC
} | {
    "modified potential": (nh.systems["henon_heiles"], "compensated", {"modified": True}),
    "user's system": (spring, "compensated", {}),
}  # fmt: skip


def kernel(name, energy="every"):
    system, how, more = KERNELS[name]
    subject = system() if callable(system) and not isinstance(system, nh.System) else system
    return build_member(physics_of(subject, **more), energy=energy, **ARITHMETIC[how])


def assembler():
    """The assembler of the CUDA compiler, a pip package for Linux."""
    spec = find_spec("nvidia.cuda_nvcc") if find_spec("nvidia") else None
    inside = [str(Path(place) / "bin/ptxas") for place in spec.submodule_search_locations] if spec else []
    return next(filter(None, map(shutil.which, [*inside, "ptxas"])), None)


@pytest.mark.parametrize("name", KERNELS)
def test_operations_of_a_kernel_have_their_rounding_and_none_is_of_a_library(name):
    text = kernel(name).ptx
    assert re.search(r"\bfma\.rn\.f64", text)
    assert re.findall(r"\b(?:add|sub|mul|fma|mad|div|sqrt)\.(?!rn\.)[\w.]*f64", text) == []
    assert re.findall(r"\.extern|\.local|f32|__nv_", text) == []


@pytest.mark.parametrize("energy", ["every", pytest.param("none", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", KERNELS)
def test_a_kernel_is_assembled_without_spills(tmp_path, name, energy):
    if (ptxas := assembler()) is None:
        pytest.skip("the assembler of the CUDA compiler is not installed")
    (tmp_path / "kernel.ptx").write_text(kernel(name, energy).ptx, encoding="utf-8")
    call = [ptxas, "-v", "-arch=sm_90", "kernel.ptx", "-o", "kernel.cubin"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert re.search(r"\b0 bytes spill stores, 0 bytes spill loads", done.stderr)
    (registers,) = re.findall(r"Used (\d+) registers", done.stderr)
    assert int(registers) <= 168  # three blocks of 128 threads an SM: 65 536 registers
