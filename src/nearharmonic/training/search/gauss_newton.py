"""Descent by Gauss-Newton steps on energy errors, within the surface of the order conditions.

The mean logarithm of energy errors has narrow valleys, because each error is close to a linear function of the
coefficients that passes through 0. A Gauss-Newton step uses this. It needs the signed errors at samples of each run and
their derivatives along the surface, which are differences between a member and its neighbours. With the weight 1/|e|^2
for the errors e of each run it is a step for the sum of their logarithms, as in iteratively reweighted least squares;
damping is that of Levenberg & Marquardt. Nocedal & Wright (2006), Numerical Optimization, chapter 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from nearharmonic.numerics.types import Floats
from nearharmonic.training.objective import WEIGHT_OF_MEAN, Objective
from nearharmonic.training.population import LEAST, LOST

#: Samples of a run, and the distance to the neighbours whose differences are derivatives.
SAMPLES, DISTANCE = 65, 3e-5
#: Sharpness of the smooth maximum over the step sizes, in 1/decades.
SHARPNESS = 10.0
#: First damping, ratio of the dampings that are tried at once, and the damping at which a descent ends.
DAMPING, RATIO, LARGEST_DAMPING = 1e-2, 6.0, 1e8
#: Longest change of an unknown in a step; fewest steps that are tried at once.
LONGEST, FEWEST = 0.1, 5
#: Steps in succession that gain less than the smallest gain before a descent ends.
PATIENCE = 5


@dataclass
class Descent:
    """A descent in the family of an objective.

    Parameters
    ----------
    objective : Objective
        Objective whose smooth form is minimised: rms errors over samples in place of maxima over all steps, and a
        smooth maximum over the step sizes. Every member that is integrated counts as one of its trials.
    """

    objective: Objective

    def __post_init__(self) -> None:
        family = self.objective.family
        self.free = family.unknowns - len(family.equations)
        self.size = max(self.free + 1, FEWEST)
        self._populations = self.objective.populations(self.size, SAMPLES)

    def minimise(self, point: Floats, trials: int, small: float) -> Floats:
        """Return the member (n,) at which a descent from the member next to ``point`` ends.

        Points without a member next to them, or with one of too large coefficients, are returned as projected.

        Parameters
        ----------
        point : (n,) array of float
            Unknowns of the start.
        trials : int
            Number of trials after which no further step is made.
        small : float
            Gain of a step that counts as none.
        """
        last, damping, waiting = self.objective.trials + trials, DAMPING, 0
        x: Floats = self.objective.family.project(point[None])[0][0]
        value = self._values(x[None])[0]
        if not np.isfinite(value):
            return x
        while self.objective.trials < last and waiting < PATIENCE and damping < LARGEST_DAMPING and self.free:
            dampings = damping * RATIO ** np.arange(-1.0, self.size - 1)
            candidates = self._steps(x, dampings)
            values = self._values(candidates)
            best = int(values.argmin())
            if not values[best] < value:
                damping = dampings[-1] * RATIO
                continue
            waiting = waiting + 1 if value - values[best] < small else 0
            x, value, damping = candidates[best], values[best], dampings[best]
        return x

    def _steps(self, x: Floats, dampings: Floats) -> Floats:
        """Return the members (C, n) to which steps with these dampings lead."""
        family = self.objective.family
        directions = np.linalg.svd(np.atleast_2d(family.slopes(x)))[2][len(family.equations) :]
        near = family.project(np.vstack([x, x + DISTANCE * directions]))[0]
        gradient, curvature = self._derivatives(near)
        scale = np.diag(curvature) + 1e-12 * np.trace(curvature) + np.finfo(float).tiny
        matrices = curvature + dampings[:, None, None] * np.diag(scale)
        steps = np.linalg.solve(matrices, np.tile(-gradient, (len(dampings), 1))[..., None])[..., 0] @ directions
        longest = np.abs(steps).max(axis=1, keepdims=True)
        found: Floats = family.project(x + steps * np.minimum(1.0, LONGEST / np.maximum(longest, LONGEST)))[0]
        return found

    def _derivatives(self, near: Floats) -> tuple[Floats, Floats]:
        """Return the gradient (f,) and the Gauss-Newton matrix (f, f) from a member and its f neighbours."""
        errors = self._errors(near)
        weights = self._weights(self._by_tau(errors)[0])
        gradient, curvature = np.zeros(len(near) - 1), np.zeros((len(near) - 1, len(near) - 1))
        for e in errors:
            own = np.where(np.isfinite(e[0]), e[0], 0.0)
            with np.errstate(all="ignore"):  # diverged runs have no derivatives
                J = np.nan_to_num((e[1:] - e[0]) / DISTANCE, posinf=0.0, neginf=0.0)
            count = len(errors) * e.shape[2] * e.shape[3] * log(10)
            weight = weights[:, None] / ((own * own).mean(axis=-1) + LEAST**2) / count
            weighted = J * weight[..., None]
            gradient += np.einsum("itms,tms->i", weighted, own)
            curvature += np.einsum("itms,jtms->ij", weighted, J)
        return gradient, curvature

    def _values(self, members: Floats) -> Floats:
        """Return the smooth objective (C,) of at most ``size`` members; infinite for those outside."""
        inside = self.objective.inside(members)
        found = np.full(len(members), np.inf)
        if inside.any():
            by_tau = self._by_tau(self._errors(members[inside]))
            largest = by_tau.max(axis=1)
            smooth = np.log(np.exp(SHARPNESS * (by_tau - largest[:, None])).mean(axis=1)) / SHARPNESS
            found[inside] = largest + smooth + WEIGHT_OF_MEAN * by_tau.mean(axis=1)
        return found

    def _weights(self, by_tau: Floats) -> Floats:
        """Return the derivatives (T,) of the smooth objective by the differences at each step size."""
        weights = np.exp(SHARPNESS * (by_tau - by_tau.max()))
        found: Floats = weights / weights.sum() + WEIGHT_OF_MEAN / len(by_tau)
        return found

    def _errors(self, members: Floats) -> list[Floats]:
        """Return the signed errors (C, T, M, S) of members on each ensemble."""
        self.objective.trials += len(members)
        rows = self.objective.rows(members)
        return [population.energies(*rows) for population in self._populations]

    def _by_tau(self, errors: list[Floats]) -> Floats:
        """Return the mean logarithm of the rms errors minus the reference (C, T), over problems and ensembles."""
        found = []
        for e, reference in zip(errors, self.objective.references, strict=True):
            with np.errstate(all="ignore"):
                rms = np.sqrt((e * e).mean(axis=-1) + LEAST**2)
            found.append(np.log10(np.where(rms < LOST, rms, LOST)).mean(axis=-1) - reference)
        mean: Floats = np.mean(found, axis=0)
        return mean
