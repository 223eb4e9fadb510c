"""Nanoseconds per force evaluation and trajectory of a Henon-Heiles ensemble, and how time grows with its size.

Run: ``python benchmarks/ensembles.py`` (about 5 s). Each line is one step size of an ensemble on the surface H = 1/12,
from coefficients to quantiles, energy looked at 25 times a run. Initial conditions, made once for all step sizes, are
not timed. Sizes are interleaved and the minimum over the repeats kept. The last lines compare the largest ensemble
with the smallest: 1.00 is time proportional to the number of trajectories.
"""

from __future__ import annotations

from fractions import Fraction
from functools import partial

from timing import asked, shortest

import nearharmonic as nh
from nearharmonic_paper.experiments.stability.run import henon_heiles_surface, integrate_ensemble

SIZES = (1024, 4096, 16384)
METHODS = ("ruth", "aba864", "babps9o7h")
TAU_PER_STAGE = Fraction(1, 10)
T_END = Fraction(250)


def main() -> None:
    starts = {size: henon_heiles_surface(Fraction(1, 12), size, seed=1) for size in SIZES}
    evaluations = {}

    def run(name, size):
        tableau = nh.integrators[name]
        done = integrate_ensemble(tableau, TAU_PER_STAGE * tableau.stages, T_END, starts[size], surfaces=1)
        evaluations[name, size] = done.evaluations

    best = shortest(
        {(name, size): partial(run, name, size) for name in METHODS for size in SIZES}, asked(__doc__, 30).repeats
    )
    print("method        trajectories   evaluations      ms   ns per evaluation")
    for (name, size), seconds in best.items():
        count = evaluations[name, size]
        print(f"{name:13s} {size:12d} {count:13d} {1e3 * seconds:7.2f} {1e9 * seconds / count:12.3f}")
    growth = SIZES[-1] // SIZES[0]
    for name in METHODS:
        ratio = best[name, SIZES[-1]] / best[name, SIZES[0]] / growth
        print(f"{name:13s} time for {growth} times the trajectories, over {growth}: {ratio:.2f}")


if __name__ == "__main__":
    main()
