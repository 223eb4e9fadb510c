"""Runs for the quantities that a symplectic integrator conserves by construction.

The file has the samples of a short run, of its backward run and of its neighbours, and means over all steps of a long
run.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.numbers import start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, nearest_power_of_two
from nearharmonic.output.dataset import Contents, Variables, coordinate, method_coordinates, variable
from nearharmonic.systems import System, systems

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
SAMPLES = 65
SUMMATIONS = ("compensated", "plain")

#: Variables of the run file: their dimensions after ``integrator``, and their meaning.
_STATES = ("summation", "direction", "sample", "component")
MEANINGS = {
    "tau_per_stage": ((), "step size per stage, in the system's unit of time"),
    "steps": ((), "steps of the run forwards"),
    "tau": ((), "step size, in the system's unit of time"),
    "scale": (("component",), "power of two next to the largest |q| or |p|, in the system's units"),
    "state": (_STATES, "states of the run forwards, and of the run back from its end, in units of scale"),
    "state_low": (_STATES, "digits below those of state"),
    "rate": (("component", "sample"), "dq/dt and dp/dt of the compensated run forwards, in units of scale and of time"),
    "neighbour": (
        ("axis", "offset", "sample", "component"),
        "states begun beside those of the run forwards, in double-double, in units of scale",
    ),
    "neighbour_low": (("axis", "offset", "component"), "digits below those of neighbour at the end"),
    "long_steps": ((), "steps of the long run"),
    "energy_error": (("block",), "mean of (H - H0)/|H0| over all steps of each block of the long run"),
    "power": ((), "root mean square over the long run of |dT/dp dV/dq|/|H0|, in the inverse of the unit of time"),
}


def measure(system: str, integrators: Sequence[str], t_end: str) -> dict[str, Contents]:
    """Return the contents of the file ``run``: :func:`structure_runs` by names; ``t_end`` is a decimal string."""
    variables = structure_runs(systems[system], [registry[name] for name in integrators], Fraction(t_end))
    return {"run": Contents(variables=variables, coordinates=("label",))}


def structure_runs(system: System, tableaus: Sequence[Tableau], t_end: Fraction) -> Variables:
    """Integrate a system from its own initial values at t_end / 10^4 per stage with each method that fits it.

    Methods that need a quadratic T are omitted if T is not quadratic. The variables are those of :data:`MEANINGS`, NaN
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
    sizes = {name: len(values) for name, (_, values, _) in coordinates.items()} | {"sample": SAMPLES, "block": BLOCKS}
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
        steps: int, tau: Fraction = tau, start: Floats | None = None, samples: int = SAMPLES, **how: Any
    ) -> Trajectories:
        return integrate_batch(
            system, tableau, t_end=tau * steps, steps=[steps] * (1 if start is None else len(start)), samples=samples,
            start=start, numerics=Numerics(**how),
        )  # fmt: skip

    there = [run(steps, summation=name) for name in SUMMATIONS]
    back = [run(steps, -tau, _end(path), summation=name) for name, path in zip(SUMMATIONS, there, strict=True)]
    scale = np.repeat(
        [nearest_power_of_two(float(np.abs(x).max())) for x in (there[0].q, there[0].p)], system.dimension
    )
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


def _end(path: Trajectories) -> Floats:
    """Return the last states with all their digits, as starts."""
    return np.concatenate([x[:, -1] for x in (path.q, path.q_low, path.p, path.p_low)], axis=1)


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
