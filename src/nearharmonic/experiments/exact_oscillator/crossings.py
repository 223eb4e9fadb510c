"""The energy at which solving the oscillator exactly ceases to pay, where curves of errors cross, with intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nearharmonic.engine.coefficients import Floats
from nearharmonic.math import exp, log
from nearharmonic.output.dataset import Variables, variable

#: Resamples of the trajectories, and the part of them that an interval holds.
RESAMPLES, CONFIDENCE = 200, 0.95


def crossing(logarithms: Floats, energies: Floats) -> Floats:
    """Return the energies (...) up to which the exact oscillator errs less.

    Parameters
    ----------
    logarithms : (..., E) array of float
        Logarithm of its error over that of the other method, at each energy.
    energies : (E,) array of float
        Ascending.

    Returns
    -------
    array of float
        Where the logarithm first rises above 0, interpolated in the logarithm of the energy; 0 if it is above 0 at the
        first energy already, infinite if it is never.
    """
    log_energy, worse = log(energies), logarithms > 0
    first = worse.argmax(axis=-1)
    behind = np.maximum(first, 1)
    low, high = (np.take_along_axis(logarithms, (behind - k)[..., None], -1)[..., 0] for k in (1, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.clip(np.where(np.isfinite(high), -low / (high - low), 0.0), 0.0, 1.0)
    found = exp(log_energy[behind - 1] + part * (log_energy[behind] - log_energy[behind - 1]))
    return np.where(worse.any(axis=-1), np.where(first > 0, found, 0.0), np.inf)


def crossings(plain: Floats, rotated: Floats, energies: Sequence[float], seed: int) -> Variables:
    """Return the crossings of all methods, and of each exact one with the best of the others, with intervals.

    Parameters
    ----------
    plain : (T, P, E, N) array of float
        Errors of P methods that split into T and V, of N trajectories at each of E energies.
    rotated : (T, C, X, E, N) array of float
        Errors of X methods that solve the oscillator exactly, at each of C charges.
    energies : sequence of E floats
        Ascending.
    seed : int
        Chooses the resamples.
    """
    count, grid = plain.shape[-1], np.array(energies)
    draws = np.random.default_rng(seed).integers(0, count, (RESAMPLES, count))
    samples = [_pairs(plain[..., draw], rotated[..., draw], grid) for draw in draws]
    tails = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)
    variables: Variables = {}
    whole = _pairs(plain, rotated, grid)
    over = ("tau_per_stage", "charge", "exact_integrator")
    for k, (name, more, what) in enumerate((
        ("crossing", ("integrator",), "an integrator that splits into T and V"),
        ("best_crossing", (), "the best of them, at each energy,"),
    )):  # fmt: skip
        text = f"energy H up to which the median error with the exact oscillator is below that of {what}"
        ranked = np.sort(np.stack([sample[k] for sample in samples]), axis=0)
        bounds = [ranked[min(RESAMPLES - 1, int(tail * RESAMPLES))] for tail in tails]
        variables[name] = variable((*over, *more), whole[k], f"{text}; 0 if never, inf if always")
        interval = f"{text}: {CONFIDENCE:.0%} interval by resampling the trajectories"
        variables[f"{name}_interval"] = variable((*over, *more, "bound"), np.stack(bounds, axis=-1), interval)
    return variables


def _pairs(plain: Floats, rotated: Floats, energies: Floats) -> tuple[Floats, Floats]:
    """The crossings of all pairs (T, C, X, P), and those with the best (T, C, X), by medians over the trajectories."""
    logs = [log(np.median(errors, axis=-1)) for errors in (plain, rotated)]
    pairs = logs[1][:, :, :, None] - logs[0][:, None, None]
    best = logs[1] - logs[0].min(axis=1)[:, None, None]
    return crossing(pairs, energies), crossing(best, energies)
