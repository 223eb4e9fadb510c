"""Runs of the items of stability: maps, ensembles, conservation, kinetic energy, rounding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction
from math import ceil, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.engine.batch import Trajectories, integrate_batch, placed
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import start_row
from nearharmonic.engine.settings import Numerics, tau_grid
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import (
    Floats,
    Integers,
    decades,
    geometric,
    log10,
    nearest_power_of_two,
    quasi_random,
)
from nearharmonic.output.store import Contents, Variables, coordinate, method_coordinates, variable
from nearharmonic.systems import systems
from nearharmonic.systems.henon_heiles import SYSTEM as HENON_HEILES
from nearharmonic.systems.kepler import SYSTEM as MERCURY
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.relativistic_oscillator import SYSTEM as RELATIVISTIC
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings, MapSettings, RoundingSettings

# --- Kepler maps: states, energy error and loss of the orbit over eccentricity and step size.

#: The Kepler problem in units of the orbit: GM = 1 and semi-major axis 1, so H = -1/2 and the period is 2 pi.
SYSTEM: System = replace(
    MERCURY,
    parameters={"GM": Parameter(value="1", unit="1", meaning="gravitational constant times mass, the unit")},
    units=dict.fromkeys(("q", "p", "t", "energy"), "1"),
)
PERIOD = Fraction(2 * pi)
#: Number of lanes of the kernel: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: Energy error: an orbit with smaller errors at two successive step sizes is not run at smaller step sizes.
FLOOR = 1e-10


def eccentricities(settings: MapSettings) -> Floats:
    """Return eccentricities from 0 to the highest, evenly spaced in the log of the perihelion distance 1 - e."""
    distances = geometric(1.0, 1.0 - settings.highest_eccentricity, settings.eccentricities)
    return 1.0 - np.array(distances)


def evaluations_grid(settings: MapSettings) -> Floats:
    """Return the requested force evaluations per orbit, ascending and evenly spaced in the logarithm."""
    grid = settings.evaluations_per_orbit
    points = int(log10(grid.highest / grid.lowest) * grid.points_per_decade + 1e-9) + 1
    return np.array(decades(grid.lowest, grid.points_per_decade, 0, points), dtype=float)


def steps_per_orbit(settings: MapSettings, stages: int) -> Integers:
    """Return the integer numbers of steps per period nearest to the grid, so that all samples are one period apart."""
    return np.maximum(1, np.rint(evaluations_grid(settings) / stages)).astype(np.int64)


def orbit_runs(tableau: Tableau, steps: int, orbits: int, eccentricity: Floats) -> Trajectories:
    """Integrate orbits of ``eccentricity`` (n,) from their apoapsis, ``steps`` a period, sampled once a period."""
    return integrate_batch(
        SYSTEM, tableau, t_end=orbits * PERIOD, steps=np.full(eccentricity.size, orbits * steps), samples=orbits + 1,
        numerics=Numerics(width=WIDTH), start=kepler_apoapsis(eccentricity),
    )  # fmt: skip


def kepler_measure(integrator: str, settings: MapSettings) -> dict[str, Contents]:
    """Return the file ``run``: orbits under one method, over (tau_per_stage, eccentricity), step sizes in periods.

    ``energy_error`` is infinite for a lost orbit. It is NaN for an orbit that was not run, because its error is below
    :data:`FLOOR` at two coarser step sizes; ``orbits_kept``, ``q`` and ``p`` are NaN there too. Step sizes that round
    to the same number of steps per period share one computation.
    """
    tableau, grid = registry[integrator], eccentricities(settings)
    distinct, where = np.unique(steps_per_orbit(settings, tableau.stages), return_inverse=True)
    shape = (distinct.size, grid.size)
    error, kept = np.full(shape, np.nan), np.full(shape, np.nan)
    q, p = (np.full((*shape, settings.orbits + 1, SYSTEM.dimension), np.nan) for _ in range(2))
    evaluations = np.zeros(distinct.size, dtype=np.int64)
    below = np.zeros(grid.size, dtype=np.int64)
    for i, steps in enumerate(distinct.tolist()):  # coarse steps first
        needed = np.flatnonzero(below < 2)
        if not needed.size:
            break
        paths = orbit_runs(tableau, steps, settings.orbits, grid[needed])
        below[needed] = np.where(paths.max_energy_error < FLOOR, below[needed] + 1, 0)
        error[i, needed], q[i, needed], p[i, needed] = paths.max_energy_error, paths.q, paths.p
        kept[i, needed] = np.where(paths.left_at > 0, paths.left_at / steps, settings.orbits)
        evaluations[i] = paths.evaluations.sum()
    tau, over = "tau_per_stage", ("tau_per_stage", "eccentricity")
    states = (*over, "sample", "component")
    largest = "maximum of |H - H0|/|H0| over every step, inf if the orbit is lost"
    variables = {
        "q": variable(states, q[where], "position, once a period; the semi-major axis is 1"),
        "p": variable(states, p[where], "momentum, once a period; GM is 1"),
        "energy_error": variable(over, error[where], largest),
        "orbits_kept": variable(over, kept[where], "periods until |H - H0| = |H0|, or all if it never is"),
        "steps_per_orbit": variable(tau, distinct[where], "steps per period of the exact orbit"),
        "evaluations": variable(tau, evaluations[where], "force evaluations of the orbits run, all eccentricities"),
        **coordinate(tau, 1 / evaluations_grid(settings), "step size per stage asked for", "period"),
        **coordinate("eccentricity", grid, "eccentricity of the exact orbit"),
    }
    return {"run": Contents(variables=variables)}


def kepler_apoapsis(eccentricity: Floats, orientation: Floats | float = 0.0) -> Floats:
    """Return starts (n, 8) in the layout of the kernel, at the apoapsis of orbits of semi-major axis 1 with GM = 1.

    ``eccentricity`` (n,) is at least 0 and below 1; ``orientation``, (n,) or one for all, is the direction from the
    centre to the apoapsis in rad.
    """
    e = eccentricity
    cosine, sine = cos(orientation), sin(orientation)
    distance, speed = 1 + e, np.sqrt((1 - e) / (1 + e))
    starts = np.zeros((e.size, 8))
    starts[:, 0], starts[:, 1] = distance * cosine, distance * sine
    starts[:, 4], starts[:, 5] = -speed * sine, speed * cosine
    return starts


# --- Runs for the quantities that a symplectic integrator conserves by construction.
#
# The file has the samples of a short run, of its backward run and of its neighbours, and means over all steps of a long
# run.

#: Force evaluations over [0, t_end]: tau/s = 0.05 for the oscillator over 500, 241 an orbit for Mercury over ten years.
EVALUATIONS = 10**4
#: Fraction of [0, t_end] for the backward run and the tangent map: some periods, before chaos dominates.
SHORT = Fraction(1, 25)
#: Length of the long run in units of [0, t_end], and number of blocks.
LONG, BLOCKS = 10, 50
#: Spacing of the difference stencil, in units of the largest coordinate and momentum: its error is of fourth order.
SPACING = Fraction(1, 2**24)
#: Starts of the neighbours along each axis of phase space, in spacings.
OFFSETS = (-2, -1, 1, 2)
#: Maximum number of states of a short run.
CONSERVATION_SAMPLES = 65
SUMMATIONS = ("compensated", "plain")

#: Variables of the run file: their dimensions after ``integrator``, and their meaning.
_STATES = ("summation", "direction", "sample", "component")
MEANINGS = {
    "tau_per_stage": ((), "step size per stage, in the system's unit of time"),
    "steps": ((), "steps of the run forwards"),
    "tau": ((), "step size, in the system's unit of time"),
    "scale": (("component",), "power of two next to the largest |q| or |p|, in the system's units"),
    "state": (_STATES, "states of the run forwards, and of the run back from its end, in units of scale"),
    "state_low": (_STATES, "low part of state"),
    "rate": (("component", "sample"), "dq/dt and dp/dt of the compensated run forwards, in units of scale and of time"),
    "neighbour": (
        ("axis", "offset", "sample", "component"),
        "states of runs that start beside the run forwards, in double-double, in units of scale",
    ),
    "neighbour_low": (("axis", "offset", "component"), "low part of neighbour at the end"),
    "long_steps": ((), "steps of the long run"),
    "energy_error": (("block",), "mean of (H - H0)/|H0| over all steps of each block of the long run"),
    "power": ((), "root mean square over the long run of |dT/dp dV/dq|/|H0|, in the inverse of the unit of time"),
}


def conservation_measure(system: str, integrators: Sequence[str], t_end: str) -> dict[str, Contents]:
    """Return the contents of the file ``run``: :func:`structure_runs` by names; ``t_end`` is a decimal string."""
    variables = structure_runs(systems[system], [registry[name] for name in integrators], Fraction(t_end))
    return {"run": Contents(variables=variables, coordinates=("label",))}


def structure_runs(system: System, tableaus: Sequence[Tableau], t_end: Fraction) -> Variables:
    """Integrate a system from its own initial values at t_end / 10^4 per stage with each method that fits it.

    Methods that need a quadratic T are omitted if T is not quadratic. The variables are as in :data:`MEANINGS`, NaN
    after the last sample of a run.
    """
    kept = [tableau for tableau in tableaus if tableau.requires is None or system.quadratic_kinetic_energy]
    axes = [f"{kind}{i + 1}" for kind in "qp" for i in range(system.dimension)]
    coordinates = {
        **method_coordinates(kept),
        **coordinate("summation", list(SUMMATIONS), "summation of the increments"),
        **coordinate("direction", ["forwards", "back"], "direction of the run"),
        **coordinate("component", axes, "coordinate or momentum"),
        **coordinate("axis", axes, "coordinate or momentum of the start that is shifted"),
        **coordinate("offset", [float(x * SPACING) for x in OFFSETS], "shift of the start, in units of scale"),
    }
    sizes = {name: len(values) for name, (_, values, _) in coordinates.items()}
    sizes |= {"sample": CONSERVATION_SAMPLES, "block": BLOCKS}
    found: Variables = {}
    for key, (dims, meaning) in MEANINGS.items():
        over = ("integrator", *dims)
        found[key] = variable(over, np.full([sizes[name] for name in over], np.nan), meaning)
    for i, tableau in enumerate(kept):
        for key, values in _computed(system, tableau, t_end).items():
            found[key][1][(i, *map(slice, np.shape(values)))] = values
    return found | coordinates


def _computed(system: System, tableau: Tableau, t_end: Fraction) -> dict[str, Any]:
    """Return the variables of one method; a run of few steps has fewer samples."""
    steps = max(1, round(EVALUATIONS * SHORT / tableau.stages))
    long_steps, tau = round(steps * LONG / SHORT), t_end * SHORT / steps

    def run(
        steps: int, tau: Fraction = tau, start: Floats | None = None, samples: int = CONSERVATION_SAMPLES, **how: Any
    ) -> Trajectories:
        return integrate_batch(
            system, tableau, t_end=tau * steps, steps=[steps] * (1 if start is None else len(start)), samples=samples,
            start=start, numerics=Numerics(**how),
        )  # fmt: skip

    there, back = [], []
    for name in SUMMATIONS:
        there.append(path := run(steps, summation=name))
        end = np.concatenate([x[:, -1] for x in (path.q, path.q_low, path.p, path.p_low)], axis=1)
        back.append(run(steps, -tau, end, summation=name))
    largest = [nearest_power_of_two(float(np.abs(x).max())) for x in (there[0].q, there[0].p)]
    scale = np.repeat(largest, system.dimension)
    beside = run(steps, start=_beside(system, scale), precision="extended")
    long_run = run(long_steps, samples=long_steps + 1)
    (velocity, force), (long_velocity, long_force) = _rates(system, there[0]), _rates(system, long_run)
    power = np.sqrt(np.nanmean(np.square(long_velocity * long_force)))
    found = {
        "tau_per_stage": float(tau / tableau.stages),
        "steps": steps,
        "tau": float(tau),
        "scale": scale,
        "neighbour": np.stack(np.split(_phase(beside), scale.size)) / scale,
        "neighbour_low": np.stack(np.split(_phase(beside, "_low")[:, -1], scale.size)) / scale,
        "rate": np.concatenate([velocity, -force]) / scale[:, None],
        "long_steps": long_steps,
        "energy_error": [block.mean() for block in np.array_split(long_run.energy_error[0, 1:], BLOCKS)],
        "power": power / float(abs(long_run.energy[0])),
    }
    for low in ("", "_low"):
        pairs = zip(there, back, strict=True)
        found[f"state{low}"] = np.array([[_phase(path, low)[0] for path in pair] for pair in pairs]) / scale
    return found


def _beside(system: System, scale: Floats) -> Floats:
    """Return starts shifted along each axis of phase space, one row for each axis and offset."""
    q, p = system.start(Fraction)
    rows = []
    for axis, unit in enumerate(map(Fraction, scale)):
        for offset in OFFSETS:
            y = [*q, *p]
            y[axis] += offset * SPACING * unit
            rows.append(start_row(y[: len(q)], y[len(q) :]))
    return np.array(rows)


def _rates(system: System, path: Trajectories) -> tuple[Floats, Floats]:
    """Return dT/dp and dV/dq (d, S) at the states of a run."""
    formulas, constants = system.formulas(), system.constants(float)
    velocity, force = formulas.grad_T(tuple(path.p[0].T), *constants), formulas.grad_V(tuple(path.q[0].T), *constants)
    return np.array(velocity), np.array(force)


def _phase(path: Trajectories, low: str = "") -> Floats:
    """Return states (R, S, 2 d) of q and p, or their low parts."""
    return np.concatenate([getattr(path, f"{kind}{low}") for kind in "qp"], axis=2)


# --- Henon-Heiles ensembles: fraction of escaping trajectories of an energy surface, and errors of the others.

#: Box around the triangle whose corners are the saddle points: |x| up to sqrt(3)/2, and y from -1/2 to 1.
_WIDTH, _HEIGHT, _LOWEST = sqrt(3), 1.5, -0.5
#: Number of energy measurements, evenly spaced in time: enough to detect an escape soon.
LOOKS = 25
#: Quantiles of the largest |dH/H0| over the ensemble; an escaped trajectory counts as infinite.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


class EnsembleResult(NamedTuple):
    """One step size on n energy surfaces."""

    escaped: Floats  # (n,), fraction of the trajectories that left their surface
    quantiles: Floats  # (n, len(QUANTILES)), of the largest |dH/H0| over the measurements
    steps: int  # of a run that does not escape
    evaluations: int  # of the force, all trajectories together


def henon_heiles_surface(energy: Fraction, count: int, seed: int) -> Floats:
    """Return starts (count, 8) in the layout of the kernel, on the bounded part of the surface H = ``energy``.

    (x, y) is uniform in the area inside the zero-velocity curve, the direction of the momentum uniform on the circle,
    and |p| = sqrt(2 (energy - V)). In two dimensions this is the microcanonical (Liouville) measure, since
    integrating delta(p^2/2 + V - energy) p dp leaves 1 wherever V < energy.
    """
    drawn = 4 * count
    while True:
        u = quasi_random(drawn, 3, seed)
        x, y = (u[:, 0] - 0.5) * _WIDTH, u[:, 1] * _HEIGHT + _LOWEST
        kinetic = float(energy) - HENON_HEILES.V((x, y))
        # V = 1/6 on the sides of the triangle and larger beyond one side; it is smaller again only outside the box.
        inside = np.flatnonzero(kinetic > 0)
        if inside.size >= count:
            break
        drawn *= 2
    kept = inside[:count]
    momentum, angle = np.sqrt(2 * kinetic[kept]), 2 * np.pi * u[kept, 2]
    starts = np.zeros((count, 8))
    starts[:, 0], starts[:, 1] = x[kept], y[kept]
    starts[:, 4], starts[:, 5] = momentum * cos(angle), momentum * sin(angle)
    return starts


def henon_heiles_schedule(t_end: Fraction, tau: Fraction) -> tuple[int, int]:
    """Return (steps, steps between measurements).

    Measurements are evenly spaced, so that all lanes are synchronous, and a lane is refilled at a measurement. The step
    size is exact, because resonances are narrow; the interval is ``t_end`` or longer by less than one spacing.
    """
    look = max(1, round(t_end / (LOOKS * tau)))
    return look * ceil(t_end / (look * tau)), look


def integrate_ensemble(
    tableau: Tableau, tau: Fraction, t_end: Fraction, start: Floats, surfaces: int, device: str = "cpu"
) -> EnsembleResult:
    """Integrate trajectories from ``start`` (surfaces * n, 8), surface by surface, over at least [0, ``t_end``]."""
    steps, look = henon_heiles_schedule(t_end, tau)
    numerics = Numerics(width=WIDTH, energy="samples", look=look)
    numerics = placed(numerics, device, HENON_HEILES, tableau, len(start), steps * len(start))
    paths = integrate_batch(
        HENON_HEILES, tableau, t_end=steps * tau, steps=np.full(len(start), steps), samples=2, numerics=numerics,
        start=start,
    )  # fmt: skip
    errors = np.sort(paths.max_energy_error.reshape(surfaces, -1), axis=1)
    ranks = [max(1, ceil(q * errors.shape[1])) - 1 for q in QUANTILES]
    return EnsembleResult(
        escaped=(paths.left_at.reshape(surfaces, -1) > 0).mean(axis=1),
        quantiles=errors[:, ranks],
        steps=steps,
        evaluations=int(paths.evaluations.sum()),
    )


def henon_heiles_measure(integrator: str, settings: EnsembleSettings) -> dict[str, Contents]:
    """Return the file ``run``: fraction escaped and energy error of one method over (energy, tau_per_stage)."""
    tableau, grid, t_end = registry[integrator], settings.tau_per_stage.grid(), Fraction(settings.t_end)
    surfaces = [henon_heiles_surface(Fraction(e), settings.trajectories, settings.seed) for e in settings.energies]
    start = np.concatenate(surfaces)
    rows = [
        integrate_ensemble(tableau, tau * tableau.stages, t_end, start, len(settings.energies), settings.device)
        for tau in grid
    ]
    over = ("energy", "tau_per_stage")
    looks = f"quantile of the largest |H - H0|/|H0| over {LOOKS} or more evenly spaced instants, inf if escaped"
    escaped, errors, steps, evaluations = zip(*rows, strict=True)
    variables = {
        "escaped": variable(
            over, np.stack(escaped, axis=1), "fraction of the trajectories that left their energy surface"
        ),
        "energy_error": variable((*over, "quantile"), np.stack(errors, axis=1), looks),
        "steps": variable("tau_per_stage", steps, "steps of a run that does not escape"),
        "evaluations": variable("tau_per_stage", evaluations, "force evaluations of all trajectories and surfaces"),
        **coordinate("tau_per_stage", [float(tau) for tau in grid], "step size per stage"),
        **coordinate("energy", [float(Fraction(e)) for e in settings.energies], "energy H0"),
        **coordinate("quantile", list(QUANTILES), "fraction of the trajectories that err less"),
    }
    return {"run": Contents(variables=variables)}


# --- Energy errors for a T that is not quadratic: the relativistic oscillator, by amplitude.
#
# At small amplitudes the system is the harmonic oscillator; at amplitude A the momentum reaches
# sqrt((1 + A^2/2)^2 - 1). Each method runs in its own roles and with the roles of T and V exchanged. Exchanged roles
# are equivalent, after q -> p, p -> -q, to the method in its own roles on p^2/2 + sqrt(1 + q^2) - 1. This system is
# equally anharmonic, but quadratic in p: only the form of T differs.

AMPLITUDES = ("0.01", "0.03", "0.1", "0.3", "1", "3", "10")
LOWEST, HIGHEST, POINTS_PER_DECADE = 0.01, 1.0, 20
ROLES = ("own", "exchanged")


def exchanged(tableau: Tableau) -> Tableau:
    """Return ``tableau`` with the rows of drift and kick exchanged."""
    return tableau.role("kick" if tableau.first == "drift" else "drift")


def kinetic_energy_measure(integrators: Sequence[str]) -> dict[str, Contents]:
    """Return the file ``run``: energy errors over (roles, amplitude, integrator, tau_per_stage) of methods for any T.

    max_energy_error and mean_energy_error are over all steps, relative to H0, infinite for diverged runs.
    """
    kept = [registry[name] for name in integrators if registry[name].requires is None]
    grid = tau_grid(LOWEST, HIGHEST, POINTS_PER_DECADE)
    _, p0 = RELATIVISTIC.start(Fraction)
    start = np.array([start_row([Fraction(a)], p0) for a in AMPLITUDES for _ in grid])
    shape = (len(ROLES), len(AMPLITUDES), len(kept), len(grid))
    largest, mean = np.empty(shape), np.empty(shape)
    for j, tableau in enumerate(kept):
        for i, method in enumerate((tableau, exchanged(tableau))):
            steps = [method.steps(tau, RELATIVISTIC.t_end) for tau in grid] * len(AMPLITUDES)
            paths = integrate_batch(
                RELATIVISTIC, method, t_end=Fraction(RELATIVISTIC.t_end), steps=steps, samples=2, start=start
            )
            largest[i, :, j] = paths.max_energy_error.reshape(shape[1], shape[3])
            mean[i, :, j] = paths.mean_energy_error.reshape(shape[1], shape[3])
    dims = ("roles", "amplitude", "integrator", "tau_per_stage")
    variables = {
        "max_energy_error": variable(dims, largest, "maximum of |H - H0|/|H0|, inf if diverged"),
        "mean_energy_error": variable(dims, mean, "mean of |H - H0|/|H0|, inf if diverged"),
        **coordinate("roles", list(ROLES), "the method's roles of T and V, or exchanged"),
        **coordinate("amplitude", [float(a) for a in AMPLITUDES], "q at the start"),
        **method_coordinates(kept),
        **coordinate("tau_per_stage", list(grid), "step size per stage"),
    }
    return {"run": Contents(variables=variables, coordinates=("label",))}


# --- Growth of round-off over long times: energy and along-track error of an ensemble of Kepler orbits.
#
# The rounding error of a run in double precision is its difference from a run with equal method, step size and
# coefficients (rounded to double) in double-double: truncation errors and rounded coefficients cancel. Rounded
# coefficients define another method, close to the exact one; they shift the phase in proportion to time. Compensated
# sums cannot remove this shift, so it is measured separately. For double-double there is no better reference run: its
# rounding error is the difference from a run of the orbit scaled by 9 (lengths), 1/3 (momenta) and 27 (times),
# divided by sqrt(2). The scaled run rounds differently at every operation.
#
# Brouwer (1937), doi:10.1086/105423: with independent rounding errors, the energy error grows as t^(1/2), and the error
# of the position along the track, due to the mean motion, as t^(3/2).

#: Eccentricities of the ensemble: small, so that truncation errors and their modulation are small.
ECCENTRICITY = (0.05, 0.3)
#: Number of stored states of a run, evenly spaced, and number of compared times among them, evenly spaced in log t.
ROUNDING_SAMPLES, TIMES = 2000, 60
#: Digits of the differences: more than double-double has.
DIGITS = 50
#: Scale of the second run in double-double: the square of an integer that is no power of two.
SCALE_ROOT = 3
_CONSTANTS = SYSTEM.constants(Decimal)
#: Decimals of an array of floats; energies of arrays of Decimals x, y, u, v.
_decimals = np.frompyfunc(Decimal, 1, 1)
_energy = np.frompyfunc(lambda x, y, u, v: SYSTEM.energy((x, y), (u, v), _CONSTANTS), 4, 1)
#: Compared quantities, in this order.
SOURCES = ("plain", "compensated", "extended", "coefficients")


class Schedule(NamedTuple):
    """Division of a run: all steps, all periods, and samples after the start, an integer number of periods apart."""

    steps: int
    samples: int
    periods: int


def rounding_schedule(settings: RoundingSettings, stages: int) -> Schedule:
    """Return the division with the requested number of steps, rounded to an integer number of samples at apoapsis.

    At the apoapsis the truncation error of the energy is stationary, so that a lag along the track does not affect the
    energy. The number of samples is equal for all methods.
    """
    per_orbit = max(1, round(settings.evaluations_per_orbit / stages))
    samples = min(ROUNDING_SAMPLES, settings.steps // settings.evaluations_per_orbit)
    between = ceil(settings.steps / (per_orbit * samples))
    return Schedule(steps=samples * between * per_orbit, samples=samples, periods=samples * between)


def rounding_starts(settings: RoundingSettings) -> Floats:
    """Return orbits of quasi-random eccentricity and orientation (ensemble, 8)."""
    u = quasi_random(settings.ensemble, 2, settings.seed)
    lowest, highest = ECCENTRICITY
    return kepler_apoapsis(lowest + (highest - lowest) * u[:, 0], 2 * pi * u[:, 1])


def _scaled(start: Floats) -> Floats:
    """Return orbits with lengths times 9 and momenta divided by 3, as double-doubles."""
    factors = [Fraction(SCALE_ROOT**2)] * 2 + [Fraction(1, SCALE_ROOT)] * 2
    result = np.zeros_like(start)
    for row, scaled in zip(start, result, strict=True):
        for k, factor in enumerate(factors):
            place = k + 2 * (k // 2)  # x, y, their carries, then the momenta
            exact = Fraction(row[place]) * factor
            scaled[place], scaled[place + 2] = rounded_pair(exact.numerator, exact.denominator)
    return result


def states(paths: Trajectories, samples: Integers, scale: int = 1) -> NDArray[Any]:
    """Return x, y, u, v (orbits, samples, 4) as Decimals with all digits, in units of the unscaled orbit."""
    with localcontext(prec=DIGITS):
        q, p = (
            _decimals(high[:, samples]) + _decimals(low[:, samples])
            for high, low in ((paths.q, paths.q_low), (paths.p, paths.p_low))
        )
        return np.concatenate([q / scale**2, p * scale], axis=-1)


def errors(found: NDArray[Any], reference: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return energy error / |H0| and lag in mean anomaly (rad), (orbits, samples), of states against others.

    The lag is the displacement along the velocity, divided by the speed, times the mean motion, which is 1. It is a
    mean anomaly, which grows evenly, while the distance along the track oscillates with the speed.
    """
    here, there = np.moveaxis(found, -1, 0), np.moveaxis(reference, -1, 0)
    with localcontext(prec=DIGITS):
        energy = (_energy(*here) - _energy(*there)) * 2  # |H0| = 1/2
        (dx, dy), (u, v) = (here - there)[:2], there[2:]
        lag = (dx * u + dy * v) / (u * u + v * v)
    return energy.astype(float), lag.astype(float)


def rounding_measure(integrator: str, settings: RoundingSettings) -> dict[str, Contents]:
    """Return the file ``run``: energy error and lag by rounding alone over (source, orbit, sample), for one method."""
    tableau = registry[integrator]
    plan, start = rounding_schedule(settings, tableau.stages), rounding_starts(settings)
    samples = np.unique(np.array(geometric(1, plan.samples, TIMES)).round().astype(np.int64))

    def run(start: Floats = start, scale: int = 1, **how: Any) -> NDArray[Any]:
        paths = integrate_batch(
            SYSTEM, tableau, t_end=plan.periods * PERIOD * scale**3, steps=np.full(len(start), plan.steps),
            samples=plan.samples + 1, start=start, numerics=Numerics(width=WIDTH, energy="samples", **how),
        )  # fmt: skip
        return states(paths, samples, scale)

    exact, rounded_coefficients = run(precision="extended"), run(precision="extended", double_coefficients=True)
    pairs = {name: errors(run(summation=name), rounded_coefficients) for name in ("plain", "compensated")}
    energy_pair, lag_pair = errors(run(_scaled(start), SCALE_ROOT, precision="extended"), exact)
    pairs["extended"] = energy_pair / sqrt(2), lag_pair / sqrt(2)
    pairs["coefficients"] = errors(rounded_coefficients, exact)
    energy, lag = (np.array([pairs[source][k] for source in SOURCES]) for k in (0, 1))
    periods = samples * (plan.periods // plan.samples)
    over = ("source", "orbit", "sample")
    variables = {
        "energy_error": variable(over, energy, "(H - H of the exact arithmetic)/|H0|, by rounding alone"),
        "time": variable("sample", periods.astype(float), "periods of the exact orbit"),
        "lag": variable(over, lag, "displacement along the track as mean anomaly, by rounding alone", "rad"),
        **coordinate("source", list(SOURCES), "arithmetic of the run, or its coefficients alone"),
    }
    return {"run": Contents(variables=variables, coordinates=("time",))}


def warm_up(ensemble: str) -> dict[str, Contents]:
    """Compile the kernels of an ensemble into the cache; nothing is returned."""
    sums = (("double", "plain"), ("double", "compensated"), ("extended", "compensated"))
    kernels = {
        "kepler": [(SYSTEM, Numerics(width=WIDTH))],
        "henon_heiles": [(HENON_HEILES, Numerics(width=WIDTH, energy="samples"))],
        "rounding": [(SYSTEM, Numerics(precision=p, summation=s, width=WIDTH, energy="samples")) for p, s in sums],
    }
    for system, numerics in kernels[ensemble]:
        kernel_of(system, numerics)
    return {}
