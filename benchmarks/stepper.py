"""Times of a step inside a loop of numba, of a run, and of a leapfrog written by hand.

Run: ``python benchmarks/stepper.py`` (half a minute); ``--page`` writes the table to ``docs/how_to/stepper.md``. Times
are minima of calls that take turns on one core.
"""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
from timing import asked, shortest, show

import nearharmonic as nh
from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes

PAGE = "docs/how_to/stepper.md"
CHAIN = str(Path(__file__).parents[1] / "examples/fput_recurrence.py")
#: Step size, and steps of a call.
SETTINGS = {"henon_heiles": (0.1, 200_000), "kepler": (36.0, 100_000), CHAIN: (0.1, 20_000)}
METHODS = ("leapfrog", "babs7o7h")


@numba.njit
def henon_heiles(q, p, tau):
    q[0] += 0.5 * tau * p[0]
    q[1] += 0.5 * tau * p[1]
    x, y = q[0], q[1]
    p[0] -= tau * (x + 2 * x * y)
    p[1] -= tau * (y + x * x - y * y)
    q[0] += 0.5 * tau * p[0]
    q[1] += 0.5 * tau * p[1]


@numba.njit
def kepler(q, p, tau):
    q[0] += 0.5 * tau * p[0]
    q[1] += 0.5 * tau * p[1]
    square = q[0] * q[0] + q[1] * q[1]
    pull = tau * 1.72 / (square * np.sqrt(square))
    p[0] -= pull * q[0]
    p[1] -= pull * q[1]
    q[0] += 0.5 * tau * p[0]
    q[1] += 0.5 * tau * p[1]


@numba.njit
def chain(q, p, tau):
    """With a quarter of the cubes of the strains in V, and both ends held."""
    sites = q.size
    for i in range(sites):
        q[i] += 0.5 * tau * p[i]
    left = q[0] + 0.25 * q[0] * q[0]
    for i in range(sites):
        strain = (q[i + 1] if i < sites - 1 else 0.0) - q[i]
        right = strain + 0.25 * strain * strain
        p[i] += tau * (right - left)
        left = right
    for i in range(sites):
        q[i] += 0.5 * tau * p[i]


BY_HAND = {"henon_heiles": henon_heiles, "kepler": kepler, CHAIN: chain}


def looped(step, system, tau, steps):
    """A call of a loop of steps from the start of the system."""

    @numba.njit
    def loop(q, p, tau, steps):
        for _ in range(steps):
            step(q, p, tau)

    q0, p0 = (np.array([float(x) for x in row]) for row in (system.q0, system.p0))
    loop(q0.copy(), p0.copy(), tau, 1)
    return lambda: loop(q0.copy(), p0.copy(), tau, steps)


def measured(repeats):
    """Seconds a step of each system, by (method, step or run), and of the leapfrog by hand."""
    found = {}
    for name, (tau, steps) in SETTINGS.items():
        system = nh.systems[name]
        calls = {"by hand": looped(BY_HAND[name], system, tau, steps)}
        for method in METHODS:
            calls[method, "step"] = looped(nh.stepper(system, method), system, tau, steps)
            problem = nh.problem(system, method, t_end=tau * steps, summation="plain", energy="none")
            calls[method, "run"] = lambda problem=problem, tau=tau: problem(tau)
        found[name] = {key: seconds / steps for key, seconds in shortest(calls, repeats).items()}
    return found


def parts(times, machine):
    """The table of the page, in ns."""
    rows = []
    for name, one in times.items():
        for method in METHODS:
            found = [one[method, "step"], one[method, "run"], *([one["by hand"]] if method == "leapfrog" else [])]
            cells = [f"{1e9 * t:.0f}" for t in found]
            rows.append([nh.systems[name].label, nh.integrators[method].label, *cells, *[""] * (3 - len(cells))])
    table = pipes(["system", "method", "step", "run", "leapfrog by hand"], rows, align="llr")
    return {"steps": "\n".join([*table, "", f"Machine: {machine}."])}


def main() -> None:
    options = asked(__doc__, 20, page=PAGE)
    show(parts(measured(options.repeats), processor()), PAGE, options.page)


if __name__ == "__main__":
    main()
