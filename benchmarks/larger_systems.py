"""Systems of many coordinates, whose formulas are compiled as loops, beside C: a chain of 1024 sites, a hundred bodies.

Run: ``python benchmarks/larger_systems.py`` (about a minute; needs a C compiler as ``cc``). Prints, for each system and
summation, nanoseconds a step of leapfrog without energy, for C with -O3 and with -O3 -march=native, and ours over
these; then how long the first run takes in a process of its own, with nothing compiled before.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from timing import compiled, shortest

import nearharmonic as nh
from nearharmonic.systems.definition.file import load_system

EXAMPLES = Path(__file__).parents[1] / "examples"
#: File of the system, number of sites or bodies, step size, steps of a timed run.
CASES = {"chain": ("fput_chain.py", 1024, 0.1, 2000), "bodies": ("hundred_bodies.py", 100, 0.0001, 100)}
FLAGS = {"-O3": ["-O3"], "-O3 -march=native": ["-O3", "-march=native"]}
REPEATS = 30


def c_run(library, system, count, masses, compensated, tau, steps):
    q0, p0 = system.start(float)
    state = np.concatenate([q0, np.zeros(len(q0)), p0, np.zeros(len(p0))])
    double = ctypes.POINTER(ctypes.c_double)
    mass = None if masses is None else np.array(masses, float).ctypes.data_as(double)

    def run():
        library.leapfrog(
            ctypes.c_long(steps), ctypes.c_double(tau), count, mass, compensated, state.ctypes.data_as(double)
        )

    run.alive = state, mass
    return run


def contest(name, libraries):
    """Print the times of one system."""
    path, count, tau, steps = CASES[name]
    system = load_system(EXAMPLES / path)
    masses = None if name == "chain" else [float(m) for m in system.masses[::3]]
    for summation in ("plain", "compensated"):
        end = repr(tau * steps)
        problem = nh.problem(system, "leapfrog", first="kick", energy="none", summation=summation, t_end=end)
        calls = {"ours": lambda problem=problem: problem(tau)}
        for flags, library in libraries.items():
            calls[flags] = c_run(library, system, count, masses, summation == "compensated", tau, steps)
        each = {key: 1e9 * seconds / steps for key, seconds in shortest(calls, REPEATS).items()}
        ratios = ", ".join(f"C {key} {each[key]:.0f} ns: {each['ours'] / each[key]:.2f}" for key in FLAGS)
        print(f"{name:7s}{summation:12s} ours {each['ours']:.0f} ns, {ratios}")


def first_run(name):
    """Print how long a first run takes with an empty cache of kernels."""
    path = EXAMPLES / CASES[name][0]
    with tempfile.TemporaryDirectory() as folder:
        text = (
            "import time; begin = time.perf_counter(); import nearharmonic as nh; "
            f"nh.integrate({str(path)!r}, 'leapfrog', {CASES[name][2]}, t_end={10 * CASES[name][2]}); "
            "print(time.perf_counter() - begin)"
        )
        environment = dict(os.environ, NEARHARMONIC_CACHE_DIR=folder)
        result = subprocess.run(
            [sys.executable, "-c", text], env=environment, capture_output=True, text=True, check=True
        )
    print(f"{name:7s}first run, nothing compiled before: {float(result.stdout):.1f} s")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        libraries = {key: compiled("larger_systems.c", folder, *flags) for key, flags in FLAGS.items()}
        for name in CASES:
            contest(name, libraries)
    for name in CASES:
        first_run(name)


if __name__ == "__main__":
    main()
