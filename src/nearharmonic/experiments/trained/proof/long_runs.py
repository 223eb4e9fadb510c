"""Long runs of the trained methods: trend of the energy error, way back to the start, and error by rounding alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import sqrt
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.results import Trajectories
from nearharmonic.engine.settings import Numerics
from nearharmonic.engine.statistics import student_975
from nearharmonic.experiments.trained.problems.named_systems import NAMED, named_ensemble
from nearharmonic.experiments.trained.proof.settings import ProofSettings
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.modified_integrators import method_of
from nearharmonic.output.table import Table
from nearharmonic.training.population import LANES, Ensemble, Floats

#: Systems of the runs, and starts on each of them.
SYSTEMS, STARTS = ("henon_heiles", "morse"), 16
#: Step sizes per stage, in radians of the fastest small oscillation, of the long runs and of those for rounding.
TAU_PER_STAGE, FINE = 0.1, 0.02
#: Samples of a long run; steps there and back, and evaluations of the runs for rounding, as parts of its steps.
SAMPLES, BACK, ROUNDED = 4001, Fraction(1, 100), Fraction(1, 10)
SUMS = ("compensated", "plain")
#: Samples of the runs for rounding; the median is taken over their second half.
SAMPLES_ROUNDED = 64
CAPTION = (
    "Runs from starts on the energy surfaces of the proof. Largest error at any step; trend of (H - H0)/|H0| over the "
    "whole run with the half width of its 95 % interval over the starts; distance from the start after a hundredth of "
    "the steps and as many back, median over the starts, relative to the largest coordinate and momentum; and the "
    "energy error by rounding alone, against double-double with the same coefficients, after equally many evaluations "
    "with a fifth of the step, median over the starts and the second half of the run, and with plain sums over that "
    "of the first method."
)


@dataclass(frozen=True, kw_only=True)
class Run:
    """Runs of one method on some problems, with one step size.

    Attributes
    ----------
    ensemble : Ensemble
        The problems.
    method : Tableau
        The method.
    tau_per_stage : float
        Step size per stage, in the unit of the ensemble.
    steps : int
        Steps of each run.
    """

    ensemble: Ensemble
    method: Tableau
    tau_per_stage: float
    steps: int

    def paths(self, start: Floats | None = None, *, samples: int, back: bool = False, **how: Any) -> Trajectories:
        """Return the runs, with ``samples`` states; ``how`` are members of :class:`Numerics`."""
        tau = Fraction(self.tau_per_stage * self.ensemble.unit * self.method.stages)
        return integrate_batch(
            self.ensemble.system, self.method, t_end=(-tau if back else tau) * self.steps,
            steps=np.full(self.ensemble.size, self.steps), samples=samples, numerics=Numerics(width=LANES, **how),
            start=self.ensemble.start if start is None else start, parameters=self.ensemble.parameters,
        )  # fmt: skip


def measure(methods: Sequence[str], beside: str, settings: ProofSettings) -> dict[str, Any]:
    """Return the ``table`` of long runs, a row for each system and method.

    Parameters
    ----------
    methods : sequence of str
        Names of the trained methods.
    beside : str
        Name of the method that they are compared with; it has the first row.
    settings : ProofSettings
        Steps, and the seed of the starts.
    """
    rows: list[list[Any]] = []
    for one in NAMED:
        if one.name in SYSTEMS:
            ensemble = named_ensemble(one, STARTS, settings.seed, float(settings.t_end))
            known = by_rounding(ensemble, method_of(beside), settings.steps)
            rows += [
                [one.name, name, *_row(ensemble, method_of(name), settings.steps, known[-1])]
                for name in (beside, *methods)
            ]
    header = ["system", "method", "steps", "tau_per_stage", "sum of coefficients", "max_energy_error", "trend"]
    header += ["trend_half_width", "drift", *(f"{what}_{sums}" for what in ("return", "rounding") for sums in SUMS)]
    return {"table": Table(header=[*header, "rounding_ratio"], rows=rows, caption=CAPTION)}


def _row(ensemble: Ensemble, method: Tableau, steps: int, known: float) -> list[Any]:
    long = Run(ensemble=ensemble, method=method, tau_per_stage=TAU_PER_STAGE, steps=steps)
    largest, slope, width = trend(long)
    short = Run(ensemble=ensemble, method=method, tau_per_stage=TAU_PER_STAGE, steps=max(1, int(steps * BACK)))
    rounding = by_rounding(ensemble, method, steps)
    total = sum(abs(float(c)) for row in (method.kick, method.drift) for c in row)
    drift = "no" if abs(slope) <= width else "yes" if abs(slope) > width else "lost"
    numbers = [*(way_back(short, sums) for sums in SUMS), *rounding]
    return [steps, TAU_PER_STAGE, total, largest, slope, width, drift, *numbers, rounding[-1] / known]


def trend(run: Run) -> tuple[float, float, float]:
    """Return the largest |dH/H0|, and the trend of dH/H0 over the whole run with the half width of its 95 % interval.

    The trend is the mean over the problems of least squares through the samples of each; the interval takes the
    problems as independent. NaN if a run left its energy surface.
    """
    paths = run.paths(samples=SAMPLES)
    time = paths.marks / run.steps - 0.5
    slopes = (time * paths.energy_error).sum(axis=1) / (time * time).sum(axis=1)
    width = student_975(len(slopes) - 1) * float(slopes.std(ddof=1)) / sqrt(len(slopes))
    return float(paths.max_energy_error.max()), float(slopes.mean()), width


def way_back(run: Run, summation: str) -> float:
    """Return the median distance from the start after the run and the run back with all its digits."""
    there = run.paths(samples=2, summation=summation)
    ends = np.concatenate([x[:, -1] for x in (there.q, there.q_low, there.p, there.p_low)], axis=1)
    again = run.paths(ends, samples=2, summation=summation, back=True)
    errors = []
    for high, low in ((again.q, again.q_low), (again.p, again.p_low)):
        first = there.q[:, 0] if high is again.q else there.p[:, 0]
        scale = np.abs(np.stack([first, there.q[:, -1] if high is again.q else there.p[:, -1]])).max()
        errors.append(np.abs(high[:, -1] - first + low[:, -1]).max(axis=1) / scale)
    return float(np.median(np.max(errors, axis=0)))


def by_rounding(ensemble: Ensemble, method: Tableau, steps: int) -> list[float]:
    """Return the median energy error by rounding, with each of :data:`SUMS`, after ``ROUNDED * steps`` evaluations."""
    count = max(1, round(steps * ROUNDED / method.stages))
    run = Run(ensemble=ensemble, method=method, tau_per_stage=FINE, steps=count)
    exact = run.paths(samples=SAMPLES_ROUNDED, precision="extended", double_coefficients=True).energy_error
    rounded = [run.paths(samples=SAMPLES_ROUNDED, summation=sums).energy_error for sums in SUMS]
    late = slice(exact.shape[1] // 2, None)
    return [float(np.median(np.abs(errors - exact)[:, late])) for errors in rounded]
