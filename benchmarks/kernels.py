"""Time per stage and trajectory of the kernels, beside a C compiler's version of the same step, interleaved.

Run: ``python benchmarks/kernels.py`` (about a minute; needs a C compiler as ``cc``); ``--page`` writes some rows to
``docs/results/timings.md``. Prints, for each system, summation and width, the minimum over the repeats in nanoseconds:
C as a user writes the method; C in the form of our kernels, and whether both ended in the same state, bit for bit;
ours, and ours over C in either form. The C step measures no energy; "energy" is ours with the double-double
energy at every step; "sweep" is a whole sweep of the paper's ten methods over 61 step sizes with lane refill, energies
and all, per stage actually done.
"""

from __future__ import annotations

import ctypes
import tempfile
from fractions import Fraction
from functools import partial

import numpy as np
from lanes import lane_rows, lanes_of
from timing import asked, compiled, short, shortest, show

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import moves, parameter_row, start_row
from nearharmonic.engine.settings import Numerics, steps_of
from nearharmonic.integrators import BENCHMARKED
from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes

PAGE = "docs/results/timings.md"
METHOD = "aba864"
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffp-contract=off", "-fno-math-errno")
TAU = {"sho": Fraction(1, 10), "henon_heiles": Fraction(1, 10), "kepler": Fraction(10)}
STEPS = 40_000
WIDTHS = (1, 8, 16, 32)
#: Rows of the table on the page.
SHOWN = (
    ("henon_heiles", 1, "plain"), ("henon_heiles", 1, "compensated"), ("henon_heiles", 8, "plain"),
    ("henon_heiles", 16, "compensated"), ("henon_heiles", 32, "plain"), ("kepler", 1, "plain"),
    ("kepler", 1, "compensated"), ("kepler", 8, "compensated"), ("kepler", 32, "plain"),
)  # fmt: skip
FORMS = {"as_written": "C as written", "looking_ahead": "C looking ahead", "ours": "ours"}
GRID = 10.0 ** np.linspace(-3, 0, 61)
GRID_UNIT = {"sho": 1.0, "henon_heiles": 1.0, "kepler": 100.0}


def contest(system, width, summation, library, repeats):
    """Best nanoseconds per stage and trajectory of C, of ours, and of ours with energy; and whether the bits agree."""
    problem, tableau = nh.systems[system], nh.integrators[METHOD]
    tau = TAU[system]
    (row,) = moves(tableau, [tau], 1)
    pieces = [np.array([float(sign * Fraction(c) * tau) for c in coefficients] + [0.0])
              for sign, coefficients in ((1, tableau.drift), (-1, tableau.kick))]  # fmt: skip
    start = start_row(*problem.start(Fraction), plain=summation == "plain")
    rows = lane_rows(start, parameter_row(problem.constants(Fraction)), width)
    states = {name: rows.copy() for name in ("as_written", "looking_ahead", "ours", "energy")}
    pointer, calls = ctypes.POINTER(ctypes.c_double), {}
    for form, given in (("as_written", pieces), ("looking_ahead", [row])):
        function = getattr(library, f"{system}_{width}_{summation}_{form}")
        arguments = [a.ctypes.data_as(pointer) for a in (*given, states[form])]
        calls[form] = lambda function=function, arguments=arguments: function(
            ctypes.c_long(STEPS), ctypes.c_int(tableau.stages), *arguments
        )
    lanes = {}
    for name, energy in (("ours", "samples"), ("energy", "every")):
        advance = kernel_of(problem, Numerics(width=width, energy=energy, summation=summation)).advance
        lanes[name] = lanes_of(row, width)
        calls[name] = lambda name=name, advance=advance: advance(
            STEPS, tableau.stages, False, lanes[name], states[name]
        )
    for call in calls.values():
        call()
    size = 4 * problem.dimension * width
    agree = np.array_equal(states["looking_ahead"][:size], states["ours"][:size])
    times = shortest(calls, repeats)
    return {name: 1e9 * t / (STEPS * tableau.stages * width) for name, t in times.items()}, agree


def sweep(system, repeats):
    """Best nanoseconds per stage done in a sweep of all ten methods."""
    problem = nh.systems[system]
    grid = GRID * GRID_UNIT[system]
    calls, stages = {}, 0
    for name in BENCHMARKED:
        tableau = nh.integrators[name]
        steps = [steps_of(problem.t_end, tau * tableau.stages) for tau in grid]
        run = partial(integrate_batch, problem, tableau, t_end=Fraction(problem.t_end), steps=steps, samples=2)
        calls[name] = run
        stages += int(run().evaluations.sum())
    return 1e9 * sum(shortest(calls, repeats).values()) / stages


def measured(repeats):
    """Print all that is measured; return the nanoseconds by (system, width, summation), if all bits agree."""
    found, same = {}, True
    with tempfile.TemporaryDirectory() as folder:
        library = compiled("yardstick.c", folder, *FLAGS)
        print("ns per stage and trajectory           C written  C ahead   same bits    ours  /written  /ahead  energy")
        for system in TAU:
            for summation in ("plain", "compensated"):
                for width in WIDTHS:
                    ns, agree = contest(system, width, summation, library, repeats)
                    found[system, width, summation] = ns
                    print(
                        f"{system:13s}{summation:12s}{width:3d} lane{'s' if width > 1 else ' '}"
                        f"{ns['as_written']:12.3f}{ns['looking_ahead']:9.3f}{'yes' if agree else 'NO':>9s}"
                        f"{ns['ours']:12.3f}{ns['ours'] / ns['as_written']:9.2f}"
                        f"{ns['ours'] / ns['looking_ahead']:9.2f}{ns['energy']:9.3f}"
                    )
                    same = same and agree
            each = sweep(system, max(3, repeats // 6))
            print(f"{system:13s}sweep{'':57s}{each:9.3f}")
    if not same:
        raise SystemExit("C code in the form of the kernels gives other bits: the page says that it does not")
    return found


def parts(times, machine):
    """The table of the page."""
    rows = []
    for system, width, summation in SHOWN:
        lanes = "one trajectory" if width == 1 else f"{width} lanes"
        cells = (short(times[system, width, summation][form], 2, 1) for form in FORMS)
        rows.append([f"{nh.systems[system].label}, {lanes}, {summation}", *cells])
    return {"kernels": "\n".join([*pipes(["run", *FORMS.values()], rows, align="lr"), "", f"Machine: {machine}."])}


def main() -> None:
    options = asked(__doc__, 30, page=PAGE)
    show(parts(measured(options.repeats), processor()), PAGE, options.page)


if __name__ == "__main__":
    main()
