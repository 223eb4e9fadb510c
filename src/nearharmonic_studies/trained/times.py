"""Gains at equal time on this machine, with the measured cost of the gradient of the square of grad V.

All methods without modified potentials need equal times per evaluation on one system, so that equal evaluations are
equal times. Methods with modified potentials are run again with the measured cost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch import prepared_batch
from nearharmonic.engine.numbers import moves_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import read
from nearharmonic.output.table import Table
from nearharmonic.training.population import LANES, Ensemble
from nearharmonic_paper.tasks.provenance import measures_time
from nearharmonic_studies.trained.contestants import kind_of
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.run import Trial, log_errors, proof_ensembles

#: Timed methods: one without modified potentials, and one with equal stages and a gradient in each stage.
PLAIN, MODIFIED = "mclachlan_ss5", "abag5o6"
#: Number of lanes in the timing, by the name of the column.
WIDTHS = {"lanes": LANES, "single": 1}
#: Number of steps of a timed run; number of problems of a run in lanes.
STEPS, PROBLEMS = 2000, 2 * LANES
PATIENCE = Patience(least=7, most=25, seconds=0.1, longest=1.0)
CAPTION = (
    "Nanoseconds of an evaluation and trajectory in SIMD lanes and of a single trajectory, plain sums, no energies, "
    "least of calls that took turns; what the gradient of the square of grad V costs more, in evaluations; and the "
    "gain of the best trained over the best published method, in decades, at equal evaluations and at equal time of "
    "either kind"
)


@measures_time
def measure_times(cube: str, methods: Sequence[str], settings: ProofSettings) -> dict[str, Any]:
    """Return the ``table`` of times and of gains at equal time, from the path of the cube of mean errors."""
    found = read(cube)
    names = [name for name in methods if integrators[name].modified]
    rows: list[list[Any]] = []
    known: dict[str, dict[str, tuple[float, float]]] = {}
    with pinned():
        for e, trial in enumerate(proof_ensembles(settings)):
            system = trial.ensemble.system.name
            if system not in known:
                known[system] = {mode: costs(trial.ensemble, width) for mode, width in WIDTHS.items()}
            errors = found["mean_log_error"].isel(ensemble=e, point=slice(len(trial.tau_per_stage))).values
            rows += _rows(trial, methods, names, errors, known[system])
    header = ["ensemble", "tau_per_stage", *(f"ns_{mode}" for mode in WIDTHS), *(f"charge_{mode}" for mode in WIDTHS)]
    header += ["gain", *(f"gain_{mode}" for mode in WIDTHS)]
    return {"table": Table(header=header, rows=rows, caption=f"{CAPTION}; {processor()}.")}


def costs(ensemble: Ensemble, width: int) -> tuple[float, float]:
    """Return nanoseconds per evaluation and trajectory, and the additional cost of a gradient in evaluations.

    Some problems of the ensemble are run in ``width`` SIMD lanes; with one lane, a single trajectory.
    """
    few = ensemble.part(np.arange(PROBLEMS if width > 1 else 1) % ensemble.size)
    methods = [integrators[PLAIN], integrators[MODIFIED]]
    calls = [prepared_run(few, method, width) for method in methods]
    for call in calls:
        call()
    plain, modified = (
        1e9 * min(times) / (STEPS * method.stages * few.size)
        for method, times in zip(methods, interleaved(calls, PATIENCE), strict=True)
    )
    share = getattr(methods[1], "gradients", 0) / methods[1].stages
    return plain, max(0.0, (modified / plain - 1) / share)


def prepared_run(ensemble: Ensemble, method: Tableau, width: int) -> Callable[[], None]:
    """Return a call of :data:`STEPS` steps of each problem, with a tenth of a radian per stage."""
    numerics = Numerics(summation="plain", energy="none", width=width)
    tau = Fraction(ensemble.unit * method.stages) / 10
    marks = np.tile(np.array([[0, STEPS]]), (ensemble.size, 1))
    batch = prepared_batch(
        ensemble.system, method, numerics, marks=marks, scheme=np.zeros(ensemble.size, np.int64),
        moves=moves_of(ensemble.system, method, [tau], numerics), start=ensemble.start, parameters=ensemble.parameters,
    )  # fmt: skip
    return batch.run


def _rows(
    trial: Trial, methods: Sequence[str], modified: Sequence[str], errors: Floats,
    known: dict[str, tuple[float, float]],
) -> Iterator[list[Any]]:  # fmt: skip
    """Return the rows of an ensemble, with the modified methods run again at the measured cost."""
    kinds = np.array([kind_of(name) for name in methods])
    places = [list(methods).index(name) for name in modified]
    gains = [gain(errors, kinds)]
    for _, charge in known.values():
        again = errors.copy()
        if places:
            again[places] = log_errors(trial.ensemble, modified, trial.tau_per_stage, charge).mean(axis=-1)
        gains.append(gain(again, kinds))
    for t, tau in enumerate(trial.tau_per_stage.tolist()):
        numbers = [[one[k] for one in known.values()] for k in (0, 1)]
        yield [trial.ensemble.name, tau, *numbers[0], *numbers[1], *(float(row[t]) for row in gains)]


def gain(errors: Floats, kinds: Any) -> Floats:
    """Return best published minus best trained (T,) of mean logarithms (A, T); NaN if there is none."""
    best = [errors[kinds == kind].min(axis=0, initial=np.inf) for kind in ("published", "trained")]
    found: Floats = np.where(np.isfinite(best).all(axis=0), best[0] - best[1], np.nan)
    return found
