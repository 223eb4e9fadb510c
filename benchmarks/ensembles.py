"""Nanoseconds per force evaluation and trajectory of a Henon-Heiles ensemble, and how time grows with its size.

Run: ``python benchmarks/ensembles.py`` (about 5 s). Each line is one step size of an ensemble on the surface H = 1/12,
from coefficients to quantiles, energy looked at 25 times a run. Initial conditions, made once for all step sizes, are
not timed. Sizes are interleaved and the minimum over the repeats kept. The last lines compare the largest ensemble
with the smallest: 1.00 is time proportional to the number of trajectories.
"""

from __future__ import annotations

import argparse
import os
import time
from fractions import Fraction

import numpy as np

import nearharmonic as nh
from nearharmonic.reproduction.experiments.stability.henon_heiles.run import (
    henon_heiles_surface,
    integrate_ensemble,
    warm_up,
)

SIZES = (1024, 4096, 16384)
METHODS = ("ruth", "aba864", "babps9o7h")
TAU_PER_STAGE = Fraction(1, 10)
T_END = Fraction(250)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--repeats", type=int, default=30, help="interleaved repeats of each ensemble (default 30)")
    repeats = parser.parse_args().repeats
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    warm_up()
    cases = [(name, size) for name in METHODS for size in SIZES]
    best, evaluations = dict.fromkeys(cases, np.inf), {}
    starts = {size: henon_heiles_surface(Fraction(1, 12), size, seed=1) for size in SIZES}
    for _ in range(repeats):
        for name, size in cases:
            tableau = nh.integrators[name]
            begin = time.process_time()
            done = integrate_ensemble(tableau, TAU_PER_STAGE * tableau.stages, T_END, starts[size], surfaces=1)
            best[name, size] = min(best[name, size], time.process_time() - begin)
            evaluations[name, size] = done.evaluations
    print("method        trajectories   evaluations      ms   ns per evaluation")
    for name, size in cases:
        seconds, count = best[name, size], evaluations[name, size]
        print(f"{name:13s} {size:12d} {count:13d} {1e3 * seconds:7.2f} {1e9 * seconds / count:12.3f}")
    growth = SIZES[-1] // SIZES[0]
    for name in METHODS:
        ratio = best[name, SIZES[-1]] / best[name, SIZES[0]] / growth
        print(f"{name:13s} time for {growth} times the trajectories, over {growth}: {ratio:.2f}")


if __name__ == "__main__":
    main()
