"""Long runs of the trained methods, backward runs, and runs with steps so short that rounding errors dominate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.dataset import Contents, Variables, coordinate, method_coordinates, variable
from nearharmonic.training.population import LANES, Ensemble
from nearharmonic_studies.trained.problems.named_systems import NAMED, named_ensemble
from nearharmonic_studies.trained.proof.settings import ProofSettings

#: Systems of the runs, and number of starts on each of them.
SYSTEMS, STARTS = ("henon_heiles", "morse"), 16
#: Step sizes per stage, in radians of the fastest small oscillation, of the long runs and of the runs for rounding.
TAU_PER_STAGE, FINE = 0.1, 0.02
#: Number of samples of a long run; inverse fractions of its steps for forward and backward runs, and for evaluations of
#: the runs for rounding.
SAMPLES, BACK, ROUNDED = 4001, Fraction(1, 100), Fraction(1, 10)
SUMS = ("compensated", "plain")
#: Maximum number of samples of the runs for rounding.
SAMPLES_ROUNDED = 64

#: Variables over (system, integrator): their further dimensions and meaning.
_STATES = ("summation", "problem", "end", "component")
MEANINGS = {
    "energy_error": (("problem", "sample"), "(H - H0)/|H0| of the long runs"),
    "max_energy_error": (("problem",), "maximum of |H - H0|/|H0| over every step of the long runs"),
    "q": (_STATES, "coordinates at the start, at the end of the run there and after the run back"),
    "q_low": (_STATES, "digits below those of q"),
    "p": (_STATES, "momenta at the start, at the end of the run there and after the run back"),
    "p_low": (_STATES, "digits below those of p"),
    "fine_energy_error": (("arithmetic", "problem", "fine_sample"), "(H - H0)/|H0| of the runs for rounding"),
}


def run(
    ensemble: Ensemble, method: Tableau, tau_per_stage: float, steps: int, start: Floats | None = None, *,
    samples: int, back: bool = False, **how: Any,
) -> Trajectories:  # fmt: skip
    """Return runs of one method on some problems, from their own initial conditions by default.

    ``tau_per_stage`` is in the unit of the ensemble; ``back`` reverses time; ``how`` are members of :class:`Numerics`.
    """
    tau = Fraction(tau_per_stage * ensemble.unit * method.stages)
    return integrate_batch(
        ensemble.system, method, t_end=(-tau if back else tau) * steps, steps=np.full(ensemble.size, steps),
        samples=samples, numerics=Numerics(width=LANES, **how), start=ensemble.start if start is None else start,
        parameters=ensemble.parameters,
    )  # fmt: skip


def measure(methods: Sequence[str], beside: str, settings: ProofSettings) -> dict[str, Contents]:
    """Return the file ``run``: :func:`long_runs` of the reference method ``beside``, which comes first, and others."""
    chosen = [one for one in NAMED if one.name in SYSTEMS]
    ensembles = {one.name: named_ensemble(one, STARTS, settings.seed, float(settings.t_end)) for one in chosen}
    variables = long_runs(ensembles, [integrators[name] for name in (beside, *methods)], settings.steps)
    return {"run": Contents(variables=variables, coordinates=("label", "step"))}


def long_runs(ensembles: Mapping[str, Ensemble], methods: Sequence[Tableau], steps: int) -> Variables:
    """Integrate ensembles of equal size, by the name of their system, with all methods; a long run has ``steps``.

    The variables are those of :data:`MEANINGS`, NaN after the last sample of a run and the last coordinate of a system.
    """
    samples = min(SAMPLES, steps + 1)
    coordinates = {
        **coordinate("system", list(ensembles), "system"),
        **method_coordinates(methods),
        **coordinate("summation", list(SUMS), "summation of the steps"),
        **coordinate("end", ["start", "there", "back"], "end of the runs there and back"),
        **coordinate("arithmetic", [*SUMS, "extended"], "summation of the steps, or double-double"),
    }
    sizes = {name: len(values) for name, (_, values, _) in coordinates.items()} | {
        "problem": next(iter(ensembles.values())).size, "sample": samples, "fine_sample": SAMPLES_ROUNDED,
        "component": max(one.system.dimension for one in ensembles.values()),
    }  # fmt: skip
    found: Variables = {}
    for key, (dims, meaning) in MEANINGS.items():
        over = ("system", "integrator", *dims)
        found[key] = variable(over, np.full([sizes[name] for name in over], np.nan), meaning)
    for i, ensemble in enumerate(ensembles.values()):
        for j, method in enumerate(methods):
            for key, values in _computed(ensemble, method, steps).items():
                found[key][1][(i, j, *map(slice, values.shape))] = values
    marks = np.arange(samples) * steps // (samples - 1)
    return found | coordinates | {
        "step": variable("sample", marks, "step of the sample"),
        "tau_per_stage": variable((), TAU_PER_STAGE, "step size per stage, in radians of the fastest oscillation"),
    }  # fmt: skip


def _computed(ensemble: Ensemble, method: Tableau, steps: int) -> dict[str, Floats]:
    """Return the variables of one method on one system."""
    long = run(ensemble, method, TAU_PER_STAGE, steps, samples=SAMPLES)
    short = partial(run, ensemble, method, TAU_PER_STAGE, max(1, int(steps * BACK)), samples=2)
    evaluated = max(1, round(steps * ROUNDED / method.stages))
    fine = partial(run, ensemble, method, FINE, evaluated, samples=SAMPLES_ROUNDED)
    there = [short(summation=sums) for sums in SUMS]
    ends = [np.concatenate([x[:, -1] for x in (one.q, one.q_low, one.p, one.p_low)], axis=1) for one in there]
    again = [short(end, summation=sums, back=True) for sums, end in zip(SUMS, ends, strict=True)]
    rounded = [fine(summation=sums) for sums in SUMS]
    exact = fine(precision="extended", double_coefficients=True)
    found = {
        "energy_error": long.energy_error,
        "max_energy_error": long.max_energy_error,
        "fine_energy_error": np.array([path.energy_error for path in (*rounded, exact)]),
    }
    for name in ("q", "q_low", "p", "p_low"):
        pairs = [(getattr(one, name), getattr(other, name)) for one, other in zip(there, again, strict=True)]
        found[name] = np.array([np.concatenate([one, other[:, -1:]], axis=1) for one, other in pairs])
    return found
