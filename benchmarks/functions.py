"""Cost of the functions of formulas, beside division, a hand-written vector sine and the C library, interleaved.

Run: ``python benchmarks/functions.py`` (about 20 s; needs a C compiler as ``cc``); ``--page`` writes the costs to
``docs/how_to/formulas.md``. Prints sines by hand in C, by the C library and ours; a stage of the pendulum in C with the
library's sine and in our kernels; and for each function the nanoseconds per number at one lane and at eight, the
smallest over the repeats, and their ratio to a division.
"""

from __future__ import annotations

import ctypes
import tempfile
from fractions import Fraction

import numpy as np
from lanes import lane_rows, lanes_of
from timing import asked, compiled, short, shortest, show

from nearharmonic.core import arithmetic
from nearharmonic.core.functions import ELEMENTWISE, double, elementwise, extended
from nearharmonic.core.native import loaded
from nearharmonic.core.number import FUNCTIONS
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import moves, parameter_row, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.math import cos, sin
from nearharmonic.numerics.clock import processor
from nearharmonic.output.table import pipes
from nearharmonic.systems import System

PAGE = "docs/how_to/formulas.md"
COUNT, TIMES = 512, 40
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno")
METHOD, TAU, STEPS = "aba864", Fraction(1, 10), 20_000
PENDULUM = System(
    name="pendulum", label="pendulum", V=lambda q: -cos(q[0]), grad_V=lambda q: (sin(q[0]),), q0=("1",), p0=("0.5",),
    t_end="1000", units=dict.fromkeys(("q", "p", "t", "energy"), "1"), source="benchmark",
)  # fmt: skip


def bodies():
    """Name -> (rows of arguments, body) of each function, in double and in double-double."""
    yield "division", 2, lambda x, y: [x / y]
    yield "sqrt", 1, lambda x: [x.sqrt()]
    for name, slopes in FUNCTIONS.items():
        yield name, len(slopes), lambda *x, name=name: [double.FUNCTIONS[name](*x)]
    yield "division, double-double", 4, lambda *x: arithmetic.dd_div(x[:2], x[2:])
    yield "sqrt, double-double", 2, lambda *x: arithmetic.dd_sqrt(x)
    for name, slopes in FUNCTIONS.items():
        yield (
            f"{name}, double-double", 2 * len(slopes),
            lambda *x, name=name: extended.FUNCTIONS[name](*zip(x[::2], x[1::2], strict=True)),
        )  # fmt: skip


def repeated(library, function, arguments, results):
    """Return a callable that applies ``function`` :data:`TIMES` times and keeps the arrays alive."""
    sizes = [ctypes.c_long(n) for n in arguments.shape]
    places = [ctypes.c_void_p(a.ctypes.data) for a in (arguments, results)]
    more = [ctypes.c_long(n) for n in (len(results), TIMES)]
    address = function if isinstance(function, ctypes.c_void_p) else ctypes.c_void_p(function)
    return lambda kept=(arguments, results): library.repeated(address, places[0], *sizes, places[1], *more)


def timed(calls, repeats):
    """Shortest time of each call in nanoseconds."""
    return {name: 1e9 * t for name, t in shortest(calls, repeats).items()}


def costs(library, repeats):
    """Nanoseconds per number: (name, lanes) -> time."""
    calls = {}
    random = np.random.default_rng(1)
    for name, rows, body in bodies():
        arguments = random.uniform(0.1, 10, (rows, COUNT))
        if "double-double" in name:
            arguments[1::2] = arguments[::2] * 1e-17
        results = np.empty((2 if "double-double" in name else 1, COUNT))
        for width in (1, 8):
            function = loaded(*elementwise(body, rows, width, f"f{len(calls)}"), ELEMENTWISE)
            calls[name, width] = repeated(library, function.address, arguments, results)
    return {name: t / (COUNT * TIMES) for name, t in timed(calls, repeats).items()}


def sines(library, repeats):
    """Nanoseconds per sine: by hand in C, by the C library, and ours."""
    x, y = np.random.default_rng(1).uniform(-10, 10, (1, COUNT)), np.empty((1, COUNT))
    ours = loaded(*elementwise(lambda x: [double.sin(x)], 1, 8, "ours"), ELEMENTWISE)
    functions = {"by hand": library.sines_by_hand, "by library": library.sines_by_library}
    calls = {name: repeated(library, ctypes.cast(f, ctypes.c_void_p), x, y) for name, f in functions.items()}
    calls["ours"] = repeated(library, ours.address, x, y)
    return {name: t / (COUNT * TIMES) for name, t in timed(calls, repeats).items()}


def pendulums(library, repeats):
    """Nanoseconds per stage and trajectory: C with the library's sine, our kernel at one lane and at eight."""
    tableau = integrators[METHOD]
    (row,) = moves(tableau, [TAU], 1)
    narrow = [np.array([float(sign * Fraction(c) * TAU) for c in coefficients] + [0.0])
              for sign, coefficients in ((1, tableau.drift), (-1, tableau.kick))]  # fmt: skip
    given = start_row(*PENDULUM.start(Fraction)), parameter_row(())
    pointer = ctypes.POINTER(ctypes.c_double)
    state = lane_rows(*given, 1)
    c_arguments = [a.ctypes.data_as(pointer) for a in (*narrow, state)]
    calls = {"C": lambda: library.pendulum(ctypes.c_long(STEPS), ctypes.c_int(tableau.stages), *c_arguments)}
    for width in (1, 8):
        advance = kernel_of(PENDULUM, Numerics(width=width, energy="samples")).advance
        lanes, rows = lanes_of(row, width), lane_rows(*given, width)
        calls[width] = lambda advance=advance, lanes=lanes, rows=rows: advance(
            STEPS, tableau.stages, False, lanes, rows
        )
    best = timed(calls, repeats)
    return {name: t / (STEPS * tableau.stages * (name if name == 8 else 1)) for name, t in best.items()}


def measured(repeats):
    """Print all that is measured; return the nanoseconds of the functions by (name, lanes)."""
    with tempfile.TemporaryDirectory() as folder:
        library = compiled("functions.c", folder, *FLAGS)
        found = sines(library, repeats)
        print("sine, ns per number: " + ", ".join(f"{name} {t:.3f}" for name, t in found.items()))
        print(f"ours / by hand {found['ours'] / found['by hand']:.2f}")
        found = pendulums(library, repeats)
        print("pendulum, ns per stage: " + ", ".join(f"{name} {t:.3f}" for name, t in found.items()))
        times = costs(library, repeats)
    print(f"{'ns per number':26s}  1 lane  8 lanes  / division")
    for name in dict.fromkeys(name for name, _ in times):
        one, eight = times[name, 1], times[name, 8]
        print(f"{name:26s} {one:7.2f} {eight:8.3f} {eight / times['division', 8]:11.1f}")
    return times


def parts(times, machine):
    """The table of the page: eight lanes, in units of a division of doubles."""
    unit = times["division", 8]
    rows = [
        [f"`{name}`", *(short(times[f"{name}{kind}", 8] / unit) for kind in ("", ", double-double"))]
        for name in ("sqrt", *FUNCTIONS)
    ]
    table = pipes(["function", "cost of doubles", "cost of double-doubles"], rows, align="lr")
    return {"costs": "\n".join([*table, "", f"A division of doubles takes {unit:.2f} ns. Machine: {machine}."])}


def main() -> None:
    options = asked(__doc__, 30, page=PAGE)
    show(parts(measured(options.repeats), processor()), PAGE, options.page)


if __name__ == "__main__":
    main()
