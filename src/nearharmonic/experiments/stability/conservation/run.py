"""What a symplectic integrator conserves by construction, measured: reversibility, symplecticity, the mean energy.

Beside each measured number stands what rounding alone would give. A step makes 2 s + 1 updates y += c tau dy/dt, each
rounded by up to u = 2^-53 of y (plain summation) or of the increment (compensated), of either sign: N of them add up
to sqrt(N) u times their root mean square as a random walk, and to N u times it at the worst, if all push one way. The
flow carries each error on: the sums are multiplied by the root mean square over time of the tangent map's norm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.coefficients import start_row
from nearharmonic.engine.grid import check_fit
from nearharmonic.engine.portable import nearest_power_of_two, norms
from nearharmonic.engine.results import Trajectories
from nearharmonic.engine.settings import Numerics
from nearharmonic.engine.statistics import line_fit
from nearharmonic.experiments.stability.conservation.reduce import structure_cube
from nearharmonic.experiments.stability.conservation.tables import structure_table
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import System, systems

Floats = NDArray[np.float64]

#: Unit roundoff of a double, and relative error of a double-double operation (Hida, Li & Bailey 2001).
UNIT_ROUNDOFF = 2.0**-53
DOUBLE_DOUBLE_ROUNDOFF = 2.0**-104

#: Force evaluations over [0, t_end]: tau/s = 0.05 for the oscillator over 500, 241 an orbit for Mercury over ten years.
EVALUATIONS = 10**4
#: Return and tangent map are taken over this part of [0, t_end]: some periods, before chaos decides.
SHORT = Fraction(1, 25)
#: The mean energy is followed over this many times [0, t_end], in this many blocks.
LONG, BLOCKS = 10, 50
#: Spacing of the difference stencil, in units of the largest coordinate and momentum: its error is of fourth order.
SPACING = Fraction(1, 2**24)
#: States at which the tangent map's growth is looked at.
SAMPLES = 65


@dataclass(frozen=True, kw_only=True)
class Structure:
    """Of one integrator on one system, all relative: lengths to the largest q or p, energies to |H0|.

    Attributes
    ----------
    tau_per_stage, steps, growth
        Step size per stage, steps of the run, root mean square over it of the tangent map's norm.
    return_error, return_walk, return_bound
        Distance from the start after the run forwards and back with -tau, in compensated summation, NaN if the method
        is not symmetric; what rounding gives as a random walk, and at the worst.
    plain_return_error, plain_return_walk, plain_return_bound
        The same in plain summation.
    symplectic_defect, symplectic_walk
        Largest entry of J^T Omega J - Omega, J the tangent map of the run, by differences in double-double; rounding's
        share of it.
    energy_drift, energy_drift_interval, energy_walk
        Trend of the mean energy error over the long run, its 95 % half width, and what rounding gives.
    """

    tau_per_stage: float
    steps: int
    growth: float
    return_error: float
    return_walk: float
    return_bound: float
    plain_return_error: float
    plain_return_walk: float
    plain_return_bound: float
    symplectic_defect: float
    symplectic_walk: float
    energy_drift: float
    energy_drift_interval: float
    energy_walk: float


def measure(integrators: Sequence[str], t_end: Mapping[str, str]) -> dict[str, Any]:
    """Return the ``cube`` of :class:`Structure` and its ``table``.

    Parameters
    ----------
    integrators : sequence of str
        Names of the methods. One that needs a quadratic T is left out on systems that have another.
    t_end : mapping
        Length of the interval, a decimal string, of each system by its name.
    """
    tableaus = [registry[name] for name in integrators]
    found = {
        (name, tableau.name): structure(systems[name], tableau, t_end=end)
        for name, end in t_end.items()
        for tableau in tableaus
        if tableau.requires is None or systems[name].quadratic_kinetic_energy
    }
    cube = structure_cube(list(t_end), tableaus, found)
    return {"cube": cube, "table": structure_table(cube)}


def structure(system: System, tableau: Tableau, *, t_end: str) -> Structure:
    """Measure a method on a system at t_end / 10^4 per stage.

    Parameters
    ----------
    system : System
        The system, from its own initial values.
    tableau : Tableau
        The method.
    t_end : str
        Length of the interval, a decimal string in the system's unit of time.

    Raises
    ------
    SettingError
        The method does not fit the system.
    """
    check_fit(system, tableau)
    system, end = system.autonomous(), Fraction(t_end)
    steps = max(1, round(EVALUATIONS * SHORT / tableau.stages))
    short = _Run(system, tableau, end * SHORT, steps)
    J, growth = short.tangent_map()
    drift, interval, walk = energy_drift(system, tableau, end * LONG, round(steps * LONG / SHORT))
    found: dict[str, Any] = {}
    for prefix, summation in (("", "compensated"), ("plain_", "plain")):
        total, squares = short.roundings(summation)
        found |= {
            f"{prefix}return_error": short.return_error(summation) if tableau.symmetric else nan,
            f"{prefix}return_walk": UNIT_ROUNDOFF * growth * float(np.sqrt(2 * squares)),
            f"{prefix}return_bound": UNIT_ROUNDOFF * growth * 2 * total,
        }
    _, squares = short.roundings("plain")
    return Structure(
        tau_per_stage=float(end * SHORT / steps / tableau.stages),
        steps=steps,
        growth=growth,
        **found,
        symplectic_defect=symplectic_defect(J),
        symplectic_walk=2 * growth * growth * DOUBLE_DOUBLE_ROUNDOFF * float(np.sqrt(squares) / SPACING),
        energy_drift=drift,
        energy_drift_interval=interval,
        energy_walk=walk,
    )


@dataclass(frozen=True)
class _Run:
    """One trajectory from the system's initial values, and its neighbours."""

    system: System
    tableau: Tableau
    t_end: Fraction
    steps: int

    def batch(self, summation: str = "compensated", precision: str = "double", **settings: Any) -> Trajectories:
        runs = len(settings.get("start", [None]))
        given = {"t_end": self.t_end, "samples": SAMPLES} | settings
        numerics = Numerics(precision=precision, summation=summation)
        return integrate_batch(self.system, self.tableau, steps=[self.steps] * runs, numerics=numerics, **given)

    @property
    def initial(self) -> list[Fraction]:
        """q0 and p0 in one row (2 d)."""
        q, p = self.system.start(Fraction)
        return [*q, *p]

    def scales(self) -> list[Fraction]:
        """The power of two next to the largest |q|, and to |p|, once for each component of (q, p)."""
        path = self.batch()
        largest = [nearest_power_of_two(float(np.abs(x).max())) for x in (path.q, path.p)]
        return [Fraction(x) for x in largest for _ in range(self.system.dimension)]

    def return_error(self, summation: str) -> float:
        """Largest distance of a component from its start after the run and the run back, carries included."""
        there = self.batch(summation, samples=2)
        state = np.concatenate([x[:, -1] for x in (there.q, there.q_low, there.p, there.p_low)], axis=1)
        back = self.batch(summation, samples=2, t_end=-self.t_end, start=state)
        ends = [
            Fraction(float(high)) + Fraction(float(low))
            for highs, lows in ((back.q, back.q_low), (back.p, back.p_low))
            for high, low in zip(highs[0, -1], lows[0, -1], strict=True)
        ]
        started = [Fraction(float(x)) for x in map(float, self.initial)] if summation == "plain" else self.initial
        return float(max(abs(a - b) / s for a, b, s in zip(ends, started, self.scales(), strict=True)))

    def tangent_map(self) -> tuple[list[list[Fraction]], float]:
        """J at the end, exact from states in double-double, in units of :meth:`scales`; rms over time of its norm.

        Differences of states at -2, -1, 1, 2 spacings from the start along each axis of phase space.
        """
        scales, size = self.scales(), 2 * self.system.dimension
        starts = []
        for axis in range(size):
            for shift in (-2, -1, 1, 2):
                y = list(self.initial)
                y[axis] += shift * SPACING * scales[axis]
                half = self.system.dimension
                starts.append(start_row(y[:half], y[half:]))
        path = self.batch(precision="extended", start=np.array(starts))
        high, low = (np.concatenate(pair, axis=2) for pair in ((path.q, path.p), (path.q_low, path.p_low)))
        return _differences(high[:, -1], low[:, -1], scales), _growth(high, [float(s) for s in scales])

    def roundings(self, summation: str) -> tuple[float, float]:
        """Sum and sum of squares, over all updates of the run, of the size that is rounded, in units of the scales."""
        path, scales, d = self.batch(), self.scales(), self.system.dimension
        q, p = path.q[0], path.p[0]
        if summation == "plain":
            sizes = {"drift": [_rms(q)] * len(self.tableau.drift), "kick": [_rms(p)] * len(self.tableau.kick)}
        else:
            velocity, force = self.rates(q, p)
            tau = float(self.t_end / self.steps)
            rows = (("drift", self.tableau.drift, velocity), ("kick", self.tableau.kick, force))
            sizes = {name: [abs(float(Fraction(c))) * tau * _rms(rate) for c in row] for name, row, rate in rows}
        each = np.array([x / float(scales[0]) for x in sizes["drift"]] + [x / float(scales[d]) for x in sizes["kick"]])
        return float(self.steps * d * each.sum()), float(self.steps * d * (each**2).sum())

    def rates(self, q: Floats, p: Floats) -> tuple[Floats, Floats]:
        """dT/dp and dV/dq (S, d) at the states."""
        formulas, constants = self.system.formulas(), self.system.constants(float)
        velocity, force = formulas.grad_T(tuple(p.T), *constants), formulas.grad_V(tuple(q.T), *constants)
        return np.array(velocity).T, np.array(force).T


def symplectic_defect(J: Sequence[Sequence[Fraction]]) -> float:
    """Return the largest entry of J^T Omega J - Omega, computed exactly and rounded once.

    Parameters
    ----------
    J : sequence of sequences of Fraction
        A matrix (2 d, 2 d) over (q, p).
    """
    d = len(J) // 2

    def entry(i: int, j: int) -> Fraction:
        area = sum((J[k][i] * J[d + k][j] - J[d + k][i] * J[k][j] for k in range(d)), start=Fraction(0))
        return area - (j == i + d) + (i == j + d)

    return float(max(abs(entry(i, j)) for i in range(2 * d) for j in range(2 * d)))


def energy_drift(system: System, tableau: Tableau, t_end: Fraction, steps: int) -> tuple[float, float, float]:
    """Return the trend of the mean of (H - H0)/|H0| over [0, t_end], its 95 % half width, and rounding's random walk.

    Least squares through the means of 50 blocks of all steps; NaN if the run left its energy surface. The width takes
    blocks as independent: those of a chaotic orbit are not, and its trends may pass the width two or three times.

    Parameters
    ----------
    system, tableau : System, Tableau
        What runs, from the system's initial values.
    t_end : Fraction
        Length of the interval.
    steps : int
        Steps of the run.
    """
    run = _Run(system, tableau, t_end, steps)
    path = run.batch(samples=steps + 1)
    means = np.array([block.mean() for block in np.array_split(path.energy_error[0, 1:], BLOCKS)])
    x = (np.arange(BLOCKS) + 0.5) / BLOCKS - 0.5
    slope, width = line_fit(x, means)
    velocity, force = run.rates(path.q[0], path.p[0])
    coefficients = [float(Fraction(c)) for c in (*tableau.drift, *tableau.kick)]
    # An update rounded by u c tau (dy/dt) changes the energy by that times dH/dy: for q and p alike, |dT/dp dV/dq|.
    power = _rms(velocity * force) / float(abs(path.energy[0]))
    each = float(t_end / steps) * power * float(np.sqrt(np.sum(np.square(coefficients))))
    return slope, width, UNIT_ROUNDOFF * each * float(np.sqrt(steps * system.dimension))


def _rms(values: Any) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


def _differences(high: Floats, low: Floats, scales: Sequence[Fraction]) -> list[list[Fraction]]:
    """The matrix of derivatives from states (4 per axis, 2 d) as pairs of doubles, by the five-point rule, exact."""
    size = len(scales)
    y = [
        [Fraction(float(h)) + Fraction(float(x)) for h, x in zip(*rows, strict=True)]
        for rows in zip(high, low, strict=True)
    ]
    J = [[Fraction(0)] * size for _ in range(size)]
    for axis in range(size):
        far_below, below, above, far_above = y[4 * axis : 4 * axis + 4]
        for i in range(size):
            change = 8 * (above[i] - below[i]) - (far_above[i] - far_below[i])
            J[i][axis] = change / (12 * SPACING * scales[i])
    return J


def _growth(high: Floats, scales: Sequence[float]) -> float:
    """Root mean square over the samples of the tangent map's 2-norm, from states (4 per axis, S, 2 d)."""
    change = (high[2::4] - high[1::4]) / (2 * float(SPACING) * np.array(scales))  # (axis, S, component)
    return _rms(norms(np.moveaxis(change, 1, 0)))
