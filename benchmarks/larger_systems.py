"""Systems of many coordinates, whose formulas are compiled as loops, beside C: a chain of 1024 sites, a hundred bodies.

Run: ``python benchmarks/larger_systems.py`` (about a minute; needs a C compiler as ``cc``); ``--page`` writes the table
to ``docs/how_to/larger_systems.md``. It has, for each system and summation, a step of leapfrog without energy, ours and
of C with -O3 and with -O3 -march=native; then how long the first run takes in a process of its own, with nothing
compiled before.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from timing import asked, compiled, short, shortest, show

import nearharmonic as nh
from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes
from nearharmonic.systems.system import load_system

PAGE = "docs/how_to/larger_systems.md"
EXAMPLES = Path(__file__).parents[1] / "examples"
#: File of the system, number of sites or bodies, step size, steps of a timed run.
CASES = {"chain": ("fput_chain.py", 1024, 0.1, 2000), "bodies": ("hundred_bodies.py", 100, 0.0001, 100)}
FLAGS = {"-O3": ["-O3"], "-O3 -march=native": ["-O3", "-march=native"]}
LABELS = {"chain": "chain, 1024 sites", "bodies": "100 bodies"}
SUMMATIONS = ("plain", "compensated")


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


def contest(name, libraries, repeats):
    """Seconds a step of one system, by (summation, ours or flags of C)."""
    path, count, tau, steps = CASES[name]
    system = load_system(EXAMPLES / path)
    masses = None if name == "chain" else [float(m) for m in system.masses[::3]]
    found = {}
    for summation in SUMMATIONS:
        end = repr(tau * steps)
        problem = nh.problem(system, "leapfrog", first="kick", energy="none", summation=summation, t_end=end)
        calls = {"ours": lambda problem=problem: problem(tau)}
        for flags, library in libraries.items():
            calls[flags] = c_run(library, system, count, masses, summation == "compensated", tau, steps)
        found |= {(summation, key): seconds / steps for key, seconds in shortest(calls, repeats).items()}
    return found


def first_run(name):
    """Seconds of a first run with an empty cache of kernels."""
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
    return float(result.stdout)


def measured(repeats):
    """Seconds of steps and of the first run of each system."""
    with tempfile.TemporaryDirectory() as folder:
        libraries = {key: compiled("larger_systems.c", folder, *flags) for key, flags in FLAGS.items()}
        found = {name: contest(name, libraries, repeats) for name in CASES}
    return {name: one | {"first run": first_run(name)} for name, one in found.items()}


def parts(times, machine):
    """The table of the page."""
    keys = [(summation, key) for summation in SUMMATIONS for key in ("ours", *FLAGS)]
    head = [f"{key if key == 'ours' else f'C `{key}`'}, {summation}" for summation, key in keys]
    rows = [
        [LABELS[name], *(f"{short(1e6 * one[key])} µs" for key in keys), f"{short(one['first run'])} s"]
        for name, one in times.items()
    ]
    table = pipes(["system", *head, "first run"], rows, align="lr")
    return {"steps": "\n".join([*table, "", f"Machine: {machine}."])}


def main() -> None:
    options = asked(__doc__, 30, page=PAGE)
    show(parts(measured(options.repeats), processor()), PAGE, options.page)


if __name__ == "__main__":
    main()
