"""A method of this package as a simple loop in C, written without a library and compiled with gcc.

The force is the formula of the system. The last kick of a step and the first kick of the next are merged. The compiler
may contract products and sums, which is its default.
"""

from __future__ import annotations

import ctypes
import subprocess
from functools import cache
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from nearharmonic.core.number import Constant, vector
from nearharmonic.integrators import nielsen_2015
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems.gradients import SourceTracer
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Attempt, Peer, States, start_of

FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
(METHOD,) = (tableau for tableau in nielsen_2015.TABLEAUS if tableau.name == "babps9o7h")

PROGRAM = Template("""\
#include <math.h>

enum { stages = $stages };
static const double kick[stages + 1] = { $kick };
static const double drift[stages] = { $drift };

static inline void kicked(double h, const double *q, double *p)
{
$kicked
}

static inline void drifted(double h, double *q, const double *p)
{
$drifted
}

/* `steps` steps of length tau, from state to state: the positions, then the momenta. */
void integrate(long steps, double tau, double *state)
{
    double q[$d], p[$d];
    for (int k = 0; k < $d; k++) { q[k] = state[k]; p[k] = state[$d + k]; }
    kicked(kick[0] * tau, q, p);
    for (long step = 1; step <= steps; step++) {
        for (int i = 0; i < stages; i++) {
            drifted(drift[i] * tau, q, p);
            kicked((i == stages - 1 && step < steps ? kick[stages] + kick[0] : kick[i + 1]) * tau, q, p);
        }
    }
    for (int k = 0; k < $d; k++) { state[k] = q[k]; state[$d + k] = p[k]; }
}

/* The state after each step, the first row being the start. */
void path(long steps, double tau, double *states)
{
    for (long step = 0; step < steps; step++) {
        double *next = states + (step + 1) * 2 * $d;
        for (int k = 0; k < 2 * $d; k++) next[k] = next[k - 2 * $d];
        integrate(1, tau, next);
    }
}
""")


class CTracer(SourceTracer):
    """A symbolic number that records each operation as one line of C."""

    __slots__ = ()

    def __abs__(self) -> SourceTracer:
        return self._line(f"fabs({self.name})")

    def whole_power(self, exponent: int) -> SourceTracer:
        product = " * ".join([self.name] * abs(exponent)) or "1.0"
        return self._line(product if exponent >= 0 else f"1.0 / ({product})")


def c_text(system: System, tableau: Tableau) -> str:
    """Return the text of a C program with ``integrate(steps, tau, state)`` for a method that begins with a kick."""
    kick, drift = (", ".join(map(repr, row)) for row in tableau.rows_double())
    return PROGRAM.substitute(
        stages=tableau.stages, kick=kick, drift=drift, d=system.dimension,
        kicked=_substep(system, "grad_V", "q", "p[{}] -= h * {};"),
        drifted=_substep(system, "grad_T", "p", "q[{}] += h * {};"),
    )  # fmt: skip


def _substep(system: System, gradient: str, of: str, update: str) -> str:
    lines: list[str] = []
    entries = tuple(CTracer(f"{of}[{i}]", lines) for i in range(system.dimension))
    rates = vector(system.formulas(), gradient, entries, *system.constants(Constant))
    text = [rate.name if isinstance(rate, SourceTracer) else repr(float(rate)) for rate in rates]
    updates = [update.format(i, name) for i, name in enumerate(text)]
    return "\n".join(f"    {line}" for line in (*(f"const double {line};" for line in lines), *updates))


@cache
def _compiled_loop(system: System) -> Any:
    """Return the compiled and loaded program."""
    with TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        command = ["gcc", *FLAGS, "-x", "c", "-", "-o", str(library), "-lm"]
        subprocess.run(command, input=c_text(system, METHOD), text=True, check=True, capture_output=True)
        loaded = ctypes.CDLL(str(library))
    for function in (loaded.integrate, loaded.path):
        function.argtypes = (ctypes.c_long, ctypes.c_double, ctypes.c_void_p)
        function.restype = None
    return loaded


def c_loop(system: System, t_end: float, step: float) -> Attempt:
    """BAB's9o7H in C, called with an array that holds the state."""
    program, start = _compiled_loop(system), start_of(system)
    steps = max(1, round(t_end / step))
    tau, state = t_end / steps, start.copy()
    address = state.ctypes.data

    def run() -> States:
        state[:] = start
        program.integrate(steps, tau, address)
        return state

    def path() -> tuple[States, float]:
        states = np.empty((steps + 1, start.size))
        states[0] = start
        program.path(steps, tau, states.ctypes.data)
        return states, METHOD.stages * steps + 1

    return Attempt(run=run, path=path)


PEERS = (
    Peer(
        name=f"c_{METHOD.name}", label=f"{METHOD.label}, a plain loop in C", module="gcc", stages=METHOD.stages,
        attempt=c_loop,
    ),
)  # fmt: skip
