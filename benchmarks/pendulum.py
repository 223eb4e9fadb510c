"""Time of a pendulum to reach an energy error: our kernels, and heyoka's adaptive Taylor series, interleaved.

Run: ``python benchmarks/pendulum.py`` (about 20 s; needs heyoka). The pendulum starts at angle 1 with momentum 0.5 and
runs to t = 1000. A line is one error: microseconds of one trajectory with the fastest of our methods at the largest of
its step sizes that reaches the error, of each of eight trajectories in lanes, and of heyoka at its loosest tolerance
that does; the least of the repeats, on one pinned core. The error is the largest of |H - H0| / |H0| over all steps.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from lanes import lane_rows, lanes_of
from timing import asked, shortest

import nearharmonic as nh
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import moves, parameter_row, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.math import cos, sin
from nearharmonic.recommendation.measure import fewest_for_good
from nearharmonic.systems import System
from nearharmonic_paper.experiments.work_precision.peers import TAYLOR_TOLERANCES, heyoka_taylor

T_END = 1000
METHODS = ("aba864", "babps9o7h", "abas11o6_8h", "srkn_a14", "s15odr8")
COUNTS = [int(500 * 2 ** (k / 4)) for k in range(40)]
PENDULUM = System(
    name="pendulum", label="pendulum", V=lambda q: -cos(q[0]), grad_V=lambda q: (sin(q[0]),), q0=("1",), p0=("0.5",),
    t_end=str(T_END), units=dict.fromkeys(("q", "p", "t", "energy"), "1"), source="benchmark",
)  # fmt: skip


def fewest_steps(name, errors):
    """Error -> the fewest of COUNTS steps with which a method reaches it, as it does with more steps."""
    taus = [Fraction(T_END, count) for count in COUNTS]
    worst = nh.sweep(PENDULUM, name, taus).max_energy_error.values
    fewest = {error: fewest_for_good(dict(zip(COUNTS, worst, strict=True)), error) for error in errors}
    return {error: steps for error, steps in fewest.items() if steps is not None}


def kernel_call(name, count, width):
    """A call of the inner kernel that makes ``count`` steps in each lane."""
    tableau = nh.integrators[name]
    (row,) = moves(tableau, [Fraction(T_END, count)], 1)
    rows = lane_rows(start_row(*PENDULUM.start(Fraction)), parameter_row(()), width)
    advance = kernel_of(PENDULUM, Numerics(width=width, energy="samples")).advance
    return lambda: advance(count, tableau.stages, tableau.first == "kick", lanes_of(row, width), rows.copy())


def energy_error(states):
    """The largest relative energy error of states (q, p), in rows."""
    energies = states[:, 1] ** 2 / 2 - np.cos(states[:, 0])
    return np.abs(energies / energies[0] - 1).max()


def contest(error, ours, theirs, repeats):
    """Best microseconds of our methods at one lane, each at eight, and of heyoka."""
    calls = {
        (name, w): kernel_call(name, counts[error], w)
        for name, counts in ours.items()
        if error in counts
        for w in (1, 8)
    }
    reached = [attempt for tolerance, (worst, attempt) in theirs.items() if worst <= error]
    if reached:
        calls["heyoka", 1] = reached[0].run
    return {key: 1e6 * seconds / key[1] for key, seconds in shortest(calls, repeats).items()}


def main() -> None:
    repeats = asked(__doc__, 10).repeats
    errors = (1e-6, 1e-9, 1e-12)
    ours = {name: fewest_steps(name, errors) for name in METHODS}
    attempts = {tolerance: heyoka_taylor(PENDULUM, T_END, tolerance) for tolerance in TAYLOR_TOLERANCES}
    theirs = {tolerance: (energy_error(attempt.path()[0]), attempt) for tolerance, attempt in attempts.items()}
    for error in errors:
        best = contest(error, ours, theirs, repeats)
        one, eight = (
            min((t, name) for (name, width), t in best.items() if name != "heyoka" and width == w) for w in (1, 8)
        )
        line = f"{error:.0e}: {one[1]} {one[0]:.0f} us, in lanes {eight[1]} {eight[0]:.0f} us each"
        if ("heyoka", 1) in best:
            line += f", heyoka {best['heyoka', 1]:.0f} us; ours / heyoka {one[0] / best['heyoka', 1]:.2f}"
        print(line)


if __name__ == "__main__":
    main()
