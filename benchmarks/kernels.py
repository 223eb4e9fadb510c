"""Time per stage and trajectory of the kernels, beside a C compiler's version of the same step, interleaved.

Run: ``python benchmarks/kernels.py`` (about 20 s; needs a C compiler as ``cc``). Prints, for each system and width,
the minimum over the repeats in nanoseconds, ours over C's, and whether both ended in the same state, bit for bit.
The C step measures no energy; "energy" is ours with the double-double energy at every step; "sweep" is a whole sweep
of the paper's ten methods over 61 step sizes with lane refill, energies and all, per stage actually done.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
import tempfile
import time
from fractions import Fraction
from pathlib import Path

import numpy as np

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.coefficients import coefficients, lane_rows, parameter_row, start_row
from nearharmonic.engine.grid import steps_of
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import BENCHMARKED

METHOD = "aba864"
TAU = {"sho": Fraction(1, 10), "henon_heiles": Fraction(1, 10), "kepler": Fraction(10)}
STEPS = {1: 60_000, 8: 60_000}
GRID = 10.0 ** np.linspace(-3, 0, 61)
GRID_UNIT = {"sho": 1.0, "henon_heiles": 1.0, "kepler": 100.0}


def yardstick(folder: str) -> ctypes.CDLL:
    """The compiled C file."""
    source, library = Path(__file__).with_name("yardstick.c"), Path(folder) / "yardstick.so"
    flags = ["-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, str(source), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def timed(call, repeats):
    """The shortest of ``repeats`` calls in seconds, one at a time: the caller interleaves."""
    begin = time.perf_counter()
    call()
    return min(repeats, time.perf_counter() - begin)


def contest(system, width, library, repeats):
    """Best nanoseconds per stage and trajectory of C, of ours, and of ours with energy; and whether the bits agree."""
    problem, tableau, count = nh.systems[system], nh.integrators[METHOD], STEPS[width]
    drift, kick = coefficients(tableau, [TAU[system]], 1)
    wide = [np.repeat(row[0], width, axis=1).reshape(-1) for row in (drift, kick)]
    narrow = [np.ascontiguousarray(row[0, :, 0]) for row in (drift, kick)]
    given = start_row(*problem.start(Fraction)), parameter_row(problem.constants(Fraction))
    rows = lane_rows(*given, width)
    states = {name: rows.copy() for name in ("C", "ours", "energy")}
    function = getattr(library, f"{system}_{width}")
    pointer = ctypes.POINTER(ctypes.c_double)
    c_arguments = [ctypes.c_long(count), ctypes.c_int(tableau.stages)]
    c_arguments += [a.ctypes.data_as(pointer) for a in (*narrow, states["C"])]
    kernels = {
        "ours": kernel_of(problem, Numerics(width=width, energy="samples")).advance(),
        "energy": kernel_of(problem, Numerics(width=width)).advance(),
    }
    calls = {"C": lambda: function(*c_arguments)}
    for name, advance in kernels.items():
        calls[name] = lambda name=name, advance=advance: advance(
            count, tableau.stages, False, wide[0], wide[1], states[name]
        )
    best = dict.fromkeys(calls, np.inf)
    for _ in range(repeats):
        for name, call in calls.items():
            best[name] = timed(call, best[name])
    size = 4 * problem.dimension * width
    agree = np.array_equal(states["C"][:size], states["ours"][:size])
    return {name: 1e9 * t / (count * tableau.stages * width) for name, t in best.items()}, agree


def sweep(system, repeats):
    """Best nanoseconds per stage done in a sweep of all ten methods, and the number of stages."""
    problem = nh.systems[system]
    grid = GRID * GRID_UNIT[system]
    best, stages = 0.0, 0
    for name in BENCHMARKED:
        tableau = nh.integrators[name]
        steps = [steps_of(problem.t_end, tau * tableau.stages) for tau in grid]
        shortest = np.inf
        for _ in range(repeats):
            begin = time.perf_counter()
            paths = integrate_batch(problem, tableau, t_end=Fraction(problem.t_end), steps=steps, samples=2)
            shortest = min(shortest, time.perf_counter() - begin)
        best += shortest
        stages += int(paths.evaluations.sum())
    return 1e9 * best / stages, stages


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--repeats", type=int, default=30, help="interleaved repeats of each kernel (default 30)")
    repeats = parser.parse_args().repeats
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as folder:
        library = yardstick(folder)
        print("ns per stage and trajectory     C      ours   /C     energy /C     sweep  /C     same bits")
        for system in TAU:
            for width in STEPS:
                ns, agree = contest(system, width, library, repeats)
                line = f"{system:13s} {width} lane{'s' if width > 1 else ' '}"
                line += f"{ns['C']:16.3f} {ns['ours']:8.3f} {ns['ours'] / ns['C']:5.2f}"
                line += f" {ns['energy']:8.3f} {ns['energy'] / ns['C']:5.2f}"
                if width == 8:
                    each, _ = sweep(system, max(3, repeats // 6))
                    line += f" {each:8.3f} {each / ns['C']:5.2f}"
                else:
                    line += " " * 15
                print(f"{line}     {'yes' if agree else 'NO'}")


if __name__ == "__main__":
    main()
