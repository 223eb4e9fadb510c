"""Costs of runs beside their kernels: prepared calls, ensembles, and the energy at every step of larger systems.

Run: ``python benchmarks/trajectories.py`` (about a minute). Times are minima of calls that take turns on one core.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
from lanes import lane_rows, lanes_of
from timing import asked, shortest

import nearharmonic as nh
from nearharmonic.engine.kernels import kernel_of, most_lanes
from nearharmonic.engine.numbers import moves, parameter_row, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.math import sqrt

BODIES, SITES = 10, 64


def prepared_calls(repeats):
    problem = nh.problem("henon_heiles", "aba864", t_end=1)
    problem(0.5)
    (slot,) = problem._slots[2]
    fresh = iter(range(3, 10**9))
    calls = {
        "kernel alone": slot.batch.call,
        "a step size that was seen": lambda: problem(0.5),
        "a new step size": lambda: problem(1 / next(fresh)),
        "initial values as floats": lambda: problem(0.5, q0=(0.1, 0.2)),
        "initial values as strings": lambda: problem(0.5, q0=("0.1", "0.2")),
    }
    for name, seconds in shortest(calls, repeats).items():
        print(f"problem: {name:32s}{1e6 * seconds:8.1f} microseconds")


def ensembles(members, repeats):
    system, tableau, steps = nh.systems["henon_heiles"], nh.integrators["aba864"], 1000
    rng = np.random.default_rng(1)
    q0, p0 = rng.uniform(-0.2, 0.2, (2, members, 2))
    width = most_lanes(2, compensated=True, extended=False)
    lanes = lanes_of(moves(tableau, [Fraction(1, 10)], 1)[0], width)
    fresh = lane_rows(start_row(*system.start(Fraction)), parameter_row([]), width)
    for energy in ("none", "every"):
        advance = kernel_of(system, Numerics(width=width, energy=energy)).advance

        def kernel(advance=advance):
            for _ in range(members // width):
                advance(steps, tableau.stages, False, lanes.copy(), fresh.copy())

        def whole(energy=energy):
            nh.ensemble("henon_heiles", "aba864", 0.1, q0=q0, p0=p0, t_end=100, energy=energy)

        best = shortest({"kernel": kernel, "ensemble": whole}, repeats)
        each = {name: 1e6 * seconds / members for name, seconds in best.items()}
        ratio = each["ensemble"] / each["kernel"]
        print(f"ensemble, energy {energy:6s}: {each['ensemble']:.2f} microseconds a member of {members}, "
              f"kernel {each['kernel']:.2f}: {ratio:.2f}")  # fmt: skip


def bodies():
    """A heavy body and nine light ones around it."""
    masses = [1.0] + [1e-3] * (BODIES - 1)
    rng, q0, p0 = np.random.default_rng(3), [0.0] * 3, [0.0] * 3
    for i in range(1, BODIES):
        radius, angle = 1 + 0.5 * i, rng.uniform(0, 2 * np.pi)
        q0 += [radius * np.cos(angle), radius * np.sin(angle), 0.01 * i]
        p0 += [-1e-3 * radius**-0.5 * np.sin(angle), 1e-3 * radius**-0.5 * np.cos(angle), 0.0]

    def V(q):
        pairs = ((i, j) for i in range(BODIES) for j in range(i))
        return -sum(masses[i] * masses[j] / sqrt(sum((q[3 * i + k] - q[3 * j + k]) ** 2 for k in range(3)))
                    for i, j in pairs)  # fmt: skip

    return nh.System(name="bodies", V=V, q0=q0, p0=p0, t_end=10, masses=[str(m) for m in masses for _ in range(3)])


def chain():
    """FPUT beta chain in its first mode, ends fixed."""

    def V(q):
        q = (0, *q, 0)
        return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise(q))

    q0 = [float(f"{np.sin(np.pi * (i + 1) / (SITES + 1)):.6f}") for i in range(SITES)]
    return nh.System(name="chain", V=V, q0=q0, p0=[0] * SITES, t_end=100)


def energies(repeats):
    for system, tau in ((bodies(), 0.01), (chain(), 0.1)):
        problems = {energy: nh.problem(system, "leapfrog", energy=energy) for energy in ("none", "every")}
        best = shortest({name: lambda one=one, tau=tau: one(tau) for name, one in problems.items()}, repeats)
        ratio = best["every"] / best["none"]
        print(f"energy at every step of leapfrog, {system.name:7s}{ratio:5.2f} times a run without")


def main() -> None:
    members = asked(__doc__, 100_000, "members", "members of the ensembles").members
    prepared_calls(3000)
    energies(100)
    ensembles(members, 5)


if __name__ == "__main__":
    main()
