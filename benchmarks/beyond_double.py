"""Time to reach energy errors below the rounding of doubles: double-double here, heyoka in quadruple precision.

Run: ``python benchmarks/beyond_double.py`` (about five minutes; heyoka built with quadruple precision adds its lines);
``--page`` writes the tables to ``docs/results/timings.md``.
Whole calls of prepared problems that return the final state, interleaved on one core, least of the repeats, in ms. The
error is the largest |H/H0 - 1| over every step here, and over a grid of times in heyoka; both runs are of [0, t_end] of
the system.
"""

from __future__ import annotations

from math import inf

import numpy as np
from timing import asked, short, shortest, show

import nearharmonic as nh
from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes
from nearharmonic_paper.pages.filling import power

PAGE = "docs/results/timings.md"
TARGETS = (1e-18, 1e-22, 1e-26)
METHODS = ("srkn_a14", "srkn_a19", "teloy_8a17c", "sofspa_s35o10")
#: Physical problems, in the systems in which we integrate each.
PROBLEMS = {"henon_heiles": ("henon_heiles",), "kepler": ("kepler", "kepler_regularised")}
GRID = 500
HEYOKA = "heyoka, real128"


def coarsest(problem, stages):
    """The largest of a ladder of step sizes whose error is each target at most, by target."""
    span, found = float(problem.t_end), {}
    for evaluations in np.geomspace(2000, 4e6, 50):
        tau = span * stages / evaluations
        error = problem(tau).max_energy_error if tau < span / 2 else inf
        found = {target: tau for target in TARGETS if error <= target} | found
        if len(found) == len(TARGETS):
            break
    return found


def ours(systems):
    """Calls by (target, label), each of the coarsest run of a method that reaches the target."""
    calls = {}
    for system in systems:
        for name in METHODS:
            tableau = nh.integrators[name]
            measured, timed = (nh.problem(system, name, precision="extended", energy=how) for how in ("every", "none"))
            for target, tau in coarsest(measured, tableau.stages).items():
                calls[target, label(name, system)] = lambda timed=timed, tau=tau: timed(tau).q[-1]
    return calls


def label(name, system):
    """A method and its order; regularised equations are named."""
    regularised = nh.systems[system].regularisation is not None
    tableau = nh.integrators[name]
    return f"{tableau.label}, order {tableau.order}{', regularised' if regularised else ''}"


def theirs(name):
    """Calls of heyoka in quadruple precision by (target, label), if it has it."""
    try:
        import heyoka as hy

        real = hy.real128
    except (ImportError, AttributeError):
        return {}
    system = nh.systems[name]
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    if name == "kepler":
        pull = -real(system.parameters["GM"].value) * (x * x + y * y) ** hy.expression(real("-1.5"))
        force = pull * x, pull * y
    else:
        force = -x - 2 * x * y, -y - x * x + y * y
    begin = np.array([real(c) for c in (*system.q0, *system.p0)], dtype=real)

    def energy(state):
        q, p = state[..., :2], state[..., 2:]
        if name == "kepler":
            square = q[..., 0] * q[..., 0] + q[..., 1] * q[..., 1]
            return (p * p).sum(-1) / real(2) - real(system.parameters["GM"].value) / np.sqrt(square)
        a, b = q[..., 0], q[..., 1]
        return (p * p).sum(-1) / real(2) + (a * a + b * b) / real(2) + a * a * b - b * b * b / real(3)

    calls, H0, end = {}, energy(begin), real(system.t_end)
    times = np.array([end * real(i) / real(GRID) for i in range(GRID + 1)], dtype=real)
    for tolerance in (f"1e-{k}" for k in range(17, 34)):
        equations = list(zip((x, y, u, v), (u, v, *force), strict=True))
        integrator = hy.taylor_adaptive(equations, begin.copy(), fp_type=real, tol=real(tolerance))
        error = np.abs(energy(integrator.propagate_grid(times)[-1]) / H0 - real(1)).max()

        def call(integrator=integrator):
            integrator.time = real(0)
            integrator.state[:] = begin
            integrator.propagate_until(end)
            return integrator.state

        reached = {(target, HEYOKA): call for target in TARGETS if error <= real(repr(target))}
        calls = reached | calls
        if len(calls) == len(TARGETS):
            break
    return calls


def measured(repeats):
    """Seconds of the calls of each problem, by (target, label)."""
    return {name: shortest(ours(systems) | theirs(name), repeats) for name, systems in PROBLEMS.items()}


def parts(times, machine):
    """The tables of the page, in ms; the least time of each target is bold."""
    texts = []
    for name, best in times.items():
        head = f"{nh.systems[name].label}, t = {nh.systems[name].t_end}"
        least = [min((t for (target, _), t in best.items() if target == one), default=inf) for one in TARGETS]
        rows = []
        for label in dict.fromkeys(label for _, label in best):
            found = [best.get((target, label), inf) for target in TARGETS]
            rows.append([label, *map(cell, found, least)])
        texts.append("\n".join(pipes([head, *map(power, TARGETS)], rows, align="lr")))
    return {"extended": "\n\n".join([*texts, f"Machine: {machine}."])}


def cell(seconds, least):
    """A time in ms."""
    if seconds == inf:
        return "not reached"
    text = short(1e3 * seconds)
    return f"**{text}**" if text == short(1e3 * least) else text


def main() -> None:
    options = asked(__doc__, 9, page=PAGE)
    times = measured(options.repeats)
    complete = all(HEYOKA in {label for _, label in best} for best in times.values())
    show(parts(times, processor()), PAGE, options.page if complete else None)
    if options.page and not complete:
        raise SystemExit(
            "the page stays as it is: it compares with heyoka in quadruple precision, which is not installed"
        )


if __name__ == "__main__":
    main()
