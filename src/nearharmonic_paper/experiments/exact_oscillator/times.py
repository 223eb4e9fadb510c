"""Cost of the exact oscillator on this machine, and the amplitude up to which it is better at equal time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.engine.ensemble import ensemble
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL
from nearharmonic.engine.solution import Problem
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor, summary
from nearharmonic.output.store import read
from nearharmonic.output.table import Table
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper.experiments.exact_oscillator.run import starts_on
from nearharmonic_paper.experiments.exact_oscillator.settings import ExactOscillatorSettings
from nearharmonic_paper.tasks.provenance import measures_time

#: Number of members of the timed ensemble.
MEMBERS = 256
#: Integration intervals of one trajectory and of the ensemble in the timing: a millisecond or more.
LONG, SHORT = 20_000, 4_000
PATIENCE = Patience(least=9, most=41, seconds=0.3, longest=3.0)
CAPTION_OF_TIMES = (
    "Henon-Heiles system: nanoseconds of an evaluation with T + V and with the oscillator solved exactly, compensated "
    "sums, no energies, least of calls that took turns; the charge is the ratio of the least of all methods; and the "
    "energy H and the amplitude sqrt(2H) up to which the exact oscillator has the smaller median error at equal "
    "time, beside the best of T + V"
)


@measures_time
def measure_times(cube: str, exact: Sequence[str], settings: ExactOscillatorSettings) -> dict[str, Any]:
    """Return the ``table`` of times and of crossings at equal time; the first step size of the settings is timed.

    ``cube`` is the path of the cube of crossings at given charges.
    """
    found, timed = read(cube), []
    with pinned():
        for name in exact:
            for what, calls, evaluations in _calls(name, settings):
                found_times = [summary(times) for times in interleaved(calls, PATIENCE)]
                timed.append((what, name, [(least / evaluations, middle) for least, _, middle, _ in found_times]))
    # All methods share the two kernels, so that a disturbance of one measurement does not affect all.
    charges = {
        what: min(exact[0] for kind, _, (_, exact) in timed if kind == what)
        / min(split[0] for kind, _, (split, _) in timed if kind == what)
        for what in dict.fromkeys(kind for kind, _, _ in timed)
    }
    rows = [
        [what, name, split[0] * 1e9, rotated[0] * 1e9, rotated[1] / split[1], charges[what], tau, H, sqrt(2 * H)]
        for what, name, (split, rotated) in timed
        for tau in found.tau_per_stage.values.tolist()
        for H in (crossing_at(found, name, tau, charges[what]),)
    ]
    header = ["runs", "integrator", "ns_split", "ns_exact", "ratio_of_medians", "charge", "tau_per_stage"]
    header += ["energy", "amplitude"]
    return {"table": Table(header=header, rows=rows, caption=f"{CAPTION_OF_TIMES}; {processor()}.")}


def crossing_at(cube: xr.Dataset, name: str, tau: float, charge: float) -> float:
    """Return the energy of crossing with the best T + V method at a charge between those of the cube.

    It is interpolated in the logarithm if both neighbours have a crossing; otherwise it is the smaller one.
    """
    one = cube.best_crossing.sel(exact_integrator=name, tau_per_stage=tau)
    charges, energies = one.charge.values, one.values
    if charge <= charges[0]:
        return float(energies[0])
    behind = min(int(np.searchsorted(charges, charge)), charges.size - 1)
    low, high = energies[behind - 1], energies[behind]
    if not (0 < high < np.inf and 0 < low < np.inf):
        return float(high)
    return float(np.exp(np.interp(charge, charges[behind - 1 : behind + 1], np.log([low, high]))))


def _calls(name: str, settings: ExactOscillatorSettings) -> Iterator[tuple[str, list[Callable[[], Any]], int]]:
    """Yield a name, the calls with T + V and with the exact oscillator, and their numbers of evaluations."""
    splits = KINETIC_POTENTIAL, EXACT_OSCILLATOR
    problems = [Problem(SYSTEM, name, t_end=LONG, energy="none", split=split) for split in splits]
    tau = float(Fraction(settings.tau_per_stage[0]) * problems[0].tableau.stages)
    evaluations = problems[0].tableau.stages * problems[0].steps_of(tau)
    singles: list[Callable[[], Any]] = [partial(problem, tau) for problem in problems]
    for call in singles:
        call()
    yield "one trajectory", singles, evaluations
    start = starts_on(1 / 80, MEMBERS, 1).reshape(MEMBERS, 4, 2)
    given: dict[str, Any] = {"q0": start[:, 0], "p0": start[:, 2], "t_end": SHORT, "energy": "none"}
    many: list[Callable[[], Any]] = [partial(ensemble, SYSTEM, name, tau, **given, split=split) for split in splits]
    for call in many:
        call()
    yield "ensemble", many, problems[0].tableau.stages * round(SHORT / tau) * MEMBERS
