"""Energy errors of methods on orbits, beside a measure of how far the orbits are from harmonic.

The measure is the variation of the Hessian, delta = rms |W - mean W| / rms |W| along the orbit, where W is V'' between
coordinates that are scaled by the square roots of the masses, and |.| the Frobenius norm. It is 0 for every harmonic
system, whatever its frequencies and amplitudes, and at most 1. Nothing is timed: every machine finds the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, log, log10, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.engine.trajectory import integrate, sweep
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems import System, systems
from nearharmonic.systems.system import load_system

#: The methods of the paper's figures: its own, and those that it compares them with.
NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
SIX = ("ruth", "s5odr4", "aba104", "aba864", "aba1064", "yoshida_s7o6a")
#: What the sources of the rest of the paper's Table 4 and of the methods found here begin with.
OWN = ("Nielsen", "found by", "trained by")
#: Evaluations of the force in the shortest period 2 pi / omega, omega^2 the largest |eigenvalue| of W on the orbit.
COSTS = (25, 50, 100)
#: A method's error is the median over these multiples of the step size, which no single resonance decides.
AROUND = (0.9, 0.95, 1.0, 1.05, 1.1)
#: Shortest periods that a run covers, if the system's own interval is not shorter; samples of the Hessian.
PERIODS, SAMPLES = 100, 257
#: Coordinates up to which W is formed; beyond, its norms are found from products with random vectors.
FORMED = 40
#: Energy errors that are made of rounding alone.
ROUNDING = 1e-15
#: Frequencies of the drives where they are higher than the oscillator's.
DRIVES = {"paul_trap": 2.0, "driven_oscillator": 1.5}


def others() -> tuple[str, ...]:
    """Return the names of all registered methods of other authors."""
    return tuple(name for name in plain_integrators.registered if not integrators[name].source.startswith(OWN))


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """A system from its own initial values, or from others; ``amplitude`` is their name in a table."""

    system: System
    family: str
    amplitude: str = ""
    start: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Result:
    """Measurements of an orbit: delta, omega, and the energy error of each method by cost and name."""

    orbit: Orbit
    delta: float
    omega: float
    errors: Mapping[int, Mapping[str, float]]

    def best(self, cost: int, names: Sequence[str]) -> str:
        """Return the method of the smallest error."""
        return min(names, key=self.errors[cost].__getitem__)

    def shown(self, cost: int, name: str) -> str:
        """Return the table's cell for the error of a method."""
        error = self.errors[cost][name]
        return "rounding" if error < ROUNDING else f"{error:.0e}" if error < 1 else "fails"

    def gain(self, cost: int, names: Sequence[str]) -> float:
        """Decades by which the best of NEW is better than the best of ``names``; NaN where one fails or only rounds."""
        new, other = (self.errors[cost][self.best(cost, group)] for group in (NEW, names))
        return log10(other / new) if max(new, other) < 1 and min(new, other) > ROUNDING else nan


def examples_in(files: Sequence[str]) -> dict[str, System]:
    """Return the systems that files define, by the names of the files, in their order."""
    paths = sorted(map(Path, files))
    return {path.stem: load_system(str(path)) for path in paths if "SYSTEM =" in path.read_text(encoding="utf-8")}


def orbits_of(examples: Mapping[str, System]) -> list[Orbit]:
    """Return an orbit of each example whose V is an expression, from which a Hessian is derived."""
    return [Orbit(system=one, family=name) for name, one in examples.items() if one.energies[0].traced]


def families(examples: Mapping[str, System]) -> Iterator[Orbit]:
    """Yield orbits of six systems, from small amplitudes to large ones."""
    for a in (0.05, 0.1, 0.2, 0.5, 1, 1.5, 2, 2.5, 3):
        yield Orbit(system=examples["pendulum"], family="pendulum", amplitude=f"{a} rad", start={"q0": [a]})
    for e in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.9):
        start = {"q0": [-log(1 - e)]}
        yield Orbit(system=examples["morse"], family="Morse oscillator", amplitude=f"H = {e * e:.2g} D", start=start)
    for a in (0.02, 0.05, 0.1, 0.2, 0.4, 1):
        q, p = (0.3 * a, 0.2 * a), (0.3 * a, -0.2 * a)
        label = f"H = {systems['henon_heiles'].energy(q, p):.2g}"
        yield Orbit(system=systems["henon_heiles"], family="Hénon-Heiles", amplitude=label, start={"q0": q, "p0": p})
    for name, scales in (("quartic_well", (0.05, 0.1, 0.3, 1, 3)), ("toda_chain", (0.05, 0.2, 0.5, 1, 2)),
                         ("fput_recurrence", (0.1, 0.3, 1, 3, 6))):  # fmt: skip
        system = examples[name]
        q0, p0 = system.start(float)
        for a in scales:
            start = {"q0": [a * x for x in q0], "p0": [a * x for x in p0]}
            yield Orbit(system=system, family=system.label, amplitude=f"{a} × the example's", start=start)


class Hessian:
    """W = M^(-1/2) V'' M^(-1/2) along an orbit, as a linear map: positions and times (n, d) or (n, d + 1)."""

    def __init__(self, system: System, run: xr.Dataset) -> None:
        self.formulas, self.parameters, d = system.formulas(), system.constants(float), system.dimension
        times = [run.t.values] if system.time_dependent else []
        self.places = (*run.q.values.T, *times)
        rows = np.eye(self.formulas.dimension)[:d]
        of_T = [self.formulas.hessian_T_times(rows[0], row, *self.parameters)[i] for i, row in enumerate(rows)]
        self.scales = np.sqrt(np.array(of_T, float))  # masses are diagonal in all examples

    def times(self, x: Floats) -> Floats:
        """W at each place times the rows of x, (n, d) or one row for all."""
        x = np.broadcast_to(x * self.scales, (len(self.places[0]), len(self.scales)))
        more = [np.zeros(len(x))] * (len(self.places) - len(self.scales))
        product = self.formulas.hessian_V_times(self.places, (*x.T, *more), *self.parameters)
        rows = [np.broadcast_to(row, len(x)) for row in product[: len(self.scales)]]
        found: Floats = np.stack(rows, axis=-1) * self.scales
        return found


def variation(orbit: Orbit, tau: float, t_end: float) -> tuple[float, float]:
    """delta and omega of an orbit, from a run with step size ``tau``, which need only be fine enough to follow it."""
    d = orbit.system.dimension
    samples = SAMPLES if d <= FORMED else 9
    run = integrate(orbit.system, "s15odr8", tau, t_end=t_end, samples=samples, energy="none", **orbit.start)
    hessian = Hessian(orbit.system, run)
    random = np.random.default_rng(1)
    probes = np.eye(d) if d <= FORMED else random.choice([-1.0, 1.0], (16, d))
    columns = np.stack([hessian.times(probe) for probe in probes])
    delta = np.sqrt(((columns - columns.mean(axis=1, keepdims=True)) ** 2).sum() / (columns**2).sum())
    x = random.normal(size=(len(run.t), d))
    for _ in range(100 if d <= FORMED else 30):  # the power method at each sample
        x = hessian.times(x / np.linalg.norm(x, axis=-1, keepdims=True))
    return float(delta), float(f"{np.sqrt(np.linalg.norm(x, axis=-1).max()):.3g}")


def measured(orbit: Orbit) -> Result:
    """Measure an orbit, and all methods on it."""
    system, whole = orbit.system, float(orbit.system.t_end)
    steps = 20000 if system.dimension <= FORMED else 2000
    _, omega = variation(orbit, whole / steps, whole)
    t_end = min(whole, PERIODS * 2 * pi / omega)
    delta, omega = variation(orbit, t_end / steps, t_end)
    omega = max(omega, DRIVES.get(system.name, 0))
    errors = {}
    for cost in COSTS:
        each = 2 * pi / omega / cost
        errors[cost] = {name: error(orbit, name, each, t_end) for name in (*NEW, *others())}
    return Result(orbit=orbit, delta=delta, omega=omega, errors=errors)


def error(orbit: Orbit, name: str, tau_per_stage: float, t_end: float) -> float:
    """Return the median over AROUND of the largest energy error of a method."""
    method = integrators[name]
    if method.requires and not orbit.system.quadratic_kinetic_energy:
        return inf
    taus = [method.stages * tau_per_stage * share for share in AROUND]
    if not orbit.start:
        return float(np.median(sweep(orbit.system, name, taus, t_end=t_end).max_energy_error))
    runs = [integrate(orbit.system, name, tau, t_end=t_end, samples=2, **orbit.start) for tau in taus]
    return float(np.median([float(run.max_energy_error) for run in runs]))
