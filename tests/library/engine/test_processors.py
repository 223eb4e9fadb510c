"""Results have the same bits on other processors: without vectors of 256 bits and FMA, and with AVX-512 of any kind."""

import hashlib
import json
import os
import platform
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from llvmlite import binding

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.math import atan2, cos, exp, log, sin, sqrt
from support.methods.own_systems import sites
from support.projects.decisive_computations import digests

ROOT = Path(__file__).parents[3]
PROGRAM = ROOT / "tests/support/projects/decisive_computations.py"
#: Flags of /proc/cpuinfo that the code of a processor needs, by the names under which LLVM knows those with AVX-512.
LANDING = frozenset({"avx512f", "avx512cd"})
SKYLAKE = LANDING | {"avx512bw", "avx512dq", "avx512vl"}
CANNONLAKE = SKYLAKE | {"avx512ifma", "avx512vbmi"}
ICELAKE = CANNONLAKE | {"avx512_vbmi2", "avx512_vnni", "avx512_bitalg", "avx512_vpopcntdq", "gfni", "vaes"}
RAPIDS, ZEN = ICELAKE | {"avx512_bf16", "avx512_fp16", "avx_vnni"}, ICELAKE | {"avx512_bf16", "sse4a"}
AVX512 = {
    **dict.fromkeys(("knl", "mic_avx512"), LANDING), "knm": LANDING | {"avx512_vpopcntdq"},
    **dict.fromkeys(("x86-64-v4", "skylake-avx512", "skx"), SKYLAKE), "cascadelake": SKYLAKE | {"avx512_vnni"},
    "cooperlake": SKYLAKE | {"avx512_vnni", "avx512_bf16"}, "cannonlake": CANNONLAKE,
    **dict.fromkeys(("icelake-client", "icelake-server", "rocketlake"), ICELAKE),
    "tigerlake": ICELAKE | {"avx512_vp2intersect"}, "znver4": ZEN, "znver5": ZEN | {"avx512_vp2intersect", "avx_vnni"},
    **dict.fromkeys(("sapphirerapids", "emeraldrapids", "graniterapids", "graniterapids-d"), RAPIDS),
    **dict.fromkeys(("diamondrapids", "novalake"), RAPIDS | {"avx10_2"}),
}  # fmt: skip


def older_processor():
    """The environment in which numpy, BLAS, the C library and the compiler see one: docs/explanation/processors.md."""
    features = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])  # type: ignore[index]
    return {
        "OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": " ".join(features), "NUMBA_CPU_NAME": "generic",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX512F,-FMA4",
    }  # fmt: skip


def printed_there(program, environment):
    """Output of a program in this environment."""
    paths = os.pathsep.join(map(str, (Path(nh.__file__).parents[1], ROOT / "tests")))
    environment = os.environ | {"PYTHONPATH": paths} | environment
    done = subprocess.run([sys.executable, program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_another_processor_computes_the_same_bits():
    there, libraries_there = printed_there(PROGRAM, older_processor())
    here, libraries_here = digests()
    assert there == here
    if libraries_there == libraries_here:
        pytest.skip("the libraries have the same bits, so that this machine shows nothing")


def _bumpy(q):
    """A well whose functions choose among formulas by the size of their argument."""
    (x, y), square = q, q[0] ** 2 + q[1] ** 2
    bumps = sin(3 * x) * exp(-y * y) / 4 + log(1 + x * x * y * y) / 3 + atan2(y, 1 + x * x) / 5
    return square / 2 + bumps - square**2 * sqrt(1 + cos(x) ** 2) / 40


BUMPY = nh.System(name="bumpy", V=_bumpy, q0=["0.3", "0.1"], p0=["0.2", "0.4"], t_end=60)
#: Systems, methods, steps, and sizes of the starts, of which the larger ones diverge at different steps.
MEMBERS = {
    "eight lanes": (nh.systems["henon_heiles"], "babps8o7h", 100, (0.6, 1.7)),
    "choices of functions": (BUMPY, "babps8o7h", 60, (3.9, 6)),
    "energies in double": (sites(9), "babps8o7h", 50, (2, 22)),
    "iterations": (nh.systems["henon_heiles"], "gauss16", 40, (0.6, 1.7)),
}


def results(width):
    """Digests of 19 members in so many lanes, and the steps at which they diverge."""
    found = {}
    for name, (system, method, steps, sizes) in MEMBERS.items():
        q0, p0 = (np.linspace(*sizes, 19)[:, None] * np.array(x, float) for x in (system.q0, system.p0))
        start = np.concatenate([q0, 0 * q0, p0, 0 * p0], axis=1)
        many = integrate_batch(
            system, nh.integrators[method], t_end=Fraction(60), steps=[steps] * 19, samples=4,
            numerics=Numerics(width=width), start=start,
        )  # fmt: skip
        names = ("q", "p", "q_low", "p_low", "energy_error", "block_max", "left_at", "evaluations")
        digest = hashlib.sha256(b"".join(np.nan_to_num(getattr(many, x), nan=-1.0).tobytes() for x in names))
        found[name] = digest.hexdigest(), many.left_at.tolist()
    return found


@pytest.fixture(scope="module")
def single_runs():
    found = results(1)
    assert all(len(set(steps)) >= 3 for _, steps in found.values())
    return {name: list(both) for name, both in found.items()}


def _flags():
    """Features of this processor, as Linux lists them."""
    facts = Path("/proc/cpuinfo")
    flags = re.findall(r"^flags\s*:(.*)", facts.read_text(encoding="utf-8"), re.MULTILINE) if facts.exists() else []
    return set(" ".join(flags[:1]).split())


def _processor(name):
    """A name of LLVM's, for processors that have what it needs."""
    lacking = ", ".join(sorted(AVX512[name] - _flags()))
    marks = [pytest.mark.skipif(bool(lacking), reason=f"this processor lacks {lacking}")]
    return pytest.param(name, marks=marks + [pytest.mark.long] * (name != "skylake-avx512"))


@pytest.mark.slow
@pytest.mark.parametrize("name", [_processor(name) for name in AVX512])
def test_eight_lanes_of_avx512_are_single_runs(name, single_runs):
    """Masks of lanes are in registers of their own there, and LLVM had wrong code for them."""
    assert printed_there(__file__, {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""}) == single_runs


NAMES = """
from llvmlite import binding
binding.initialize_native_target()
binding.Target.from_default_triple().create_target_machine(features="+cpuhelp")
"""
WIDE = "define <8 x double> @f(<8 x double> %x) {\n %y = fadd <8 x double> %x, %x\n ret <8 x double> %y\n}"


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="LLVM writes code for x86-64 only there")
def test_every_processor_with_avx512_is_compared():
    """Those of the names that LLVM prints whose sums of eight doubles are one instruction."""
    done = subprocess.run([sys.executable, "-c", NAMES], capture_output=True, text=True, check=True)
    names = re.findall(r"^\t(\S+)$", done.stderr, re.MULTILINE)
    assert len(names) > 50
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target, code = binding.Target.from_default_triple(), binding.parse_assembly(WIDE)
    wide = [x for x in names if "zmm" in target.create_target_machine(cpu=x, features="+64bit").emit_assembly(code)]
    # Names with underscores are others of the same.
    assert {x if x in AVX512 else x.replace("_", "-") for x in wide} == set(AVX512)


if __name__ == "__main__":
    print(json.dumps(results(8)))
