"""Anharmonicity of orbits: the variation of the Hessian of V along them.

delta = rms |W - mean W| / rms |W| along the orbit, W = V'' and |.| the Frobenius norm, for masses of 1. It is 0 for
every harmonic system, for all frequencies and amplitudes, and at most 1.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.yoshida_1990 import TABLEAUS
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System
from nearharmonic.training.population import Ensemble

#: Time between the states at which the Hessian is evaluated, in units of the ensemble, and minimum number of states. It
#: is no simple fraction of a period, to avoid aliasing.
BETWEEN, FEWEST = 0.77, 65
#: Number of steps between these states.
STEPS = 2


def with_anharmonicity(ensemble: Ensemble) -> Ensemble:
    """Return the ensemble with the anharmonicities of its problems as ``strength``."""
    return replace(ensemble, strength=anharmonicities(ensemble))


def anharmonicities(ensemble: Ensemble) -> Floats:
    """Return delta (M,) of each problem, over its interval."""
    samples = max(FEWEST, round(ensemble.t_end / ensemble.unit / BETWEEN))
    steps = STEPS * (samples - 1)
    paths = integrate_batch(
        ensemble.system, TABLEAUS[0], t_end=Fraction(ensemble.t_end), steps=np.full(ensemble.size, steps),
        samples=samples, numerics=Numerics(summation="plain", energy="samples"), start=ensemble.start,
        parameters=ensemble.parameters,
    )  # fmt: skip
    W = hessians(ensemble.system, paths.q, ensemble.parameters[:, None, ::2])
    mean = np.nanmean(W, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        found: Floats = np.sqrt(np.nansum((W - mean) ** 2, axis=(1, 2, 3)) / np.nansum(W**2, axis=(1, 2, 3)))
    return found


def hessians(system: System, q: Floats, parameters: Floats | None = None) -> Floats:
    """Return V'' (..., d, d) at positions (..., d), for parameters (..., P) or the system's own."""
    d = q.shape[-1]
    given = system.constants(float) if parameters is None else tuple(np.moveaxis(parameters, -1, 0))
    shape = q.shape[:-1]
    columns = [
        system.hessian_V_times(tuple(np.moveaxis(q, -1, 0)), tuple(map(float, unit)), *given) for unit in np.eye(d)
    ]
    rows = [np.stack([np.broadcast_to(x, shape) for x in column], axis=-1) for column in columns]
    return np.stack(rows, axis=-1)
