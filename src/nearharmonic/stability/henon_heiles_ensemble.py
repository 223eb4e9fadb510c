"""Henon-Heiles ensembles: how many trajectories of an energy surface a method loses, and how far the others err."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.batch import Floats, integrate_batch, kernel_of
from nearharmonic.stability.initial_conditions import henon_heiles_surface
from nearharmonic.stability.settings import EnsembleSettings
from nearharmonic.systems import systems
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

#: Instants at which the energy is looked at, evenly spaced in time: enough to notice an escape soon.
LOOKS = 25
#: Lanes of the kernel: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: Of the largest |dH/H0| over the ensemble, an escaped trajectory counting as infinite.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
#: A step size is trusted as long as at most this fraction escapes at it.
TOLERATED = 0.01


@dataclass(frozen=True, kw_only=True)
class EnsembleResult:
    """One step size on n surfaces: ``escaped`` (n,) fraction of the trajectories; ``quantiles`` (n, len(QUANTILES)) of
    the largest |dH/H0| over the looks; ``steps`` of a full run; ``evaluations`` of the force, all together."""

    escaped: Floats
    quantiles: Floats
    steps: int
    evaluations: int


def warm_up() -> None:
    """Compile the kernel into the cache."""
    kernel_of(systems["henon_heiles"], "double", "compensated", WIDTH, False)


def starts(settings: EnsembleSettings) -> Floats:
    """Initial conditions (surfaces * trajectories, 8), surface by surface."""
    surfaces = [henon_heiles_surface(Fraction(e), settings.trajectories, settings.seed) for e in settings.energies]
    return np.concatenate(surfaces)


def schedule(t_end: Fraction, tau: Fraction) -> tuple[int, int]:
    """(steps, steps between looks): looks come evenly, so that all lanes keep step and a lane is refilled at a look.

    The step size is kept exactly, for resonances are narrow; the interval covered is ``t_end`` or up to a look longer.
    """
    look = max(1, round(t_end / (LOOKS * tau)))
    return look * ceil(t_end / (look * tau)), look


def integrate_ensemble(
    tableau: Tableau, tau: Fraction, t_end: Fraction, start: Floats, surfaces: int
) -> EnsembleResult:
    """All of ``start`` (surfaces * n, 8), surface by surface, over at least [0, ``t_end``] at one step size."""
    steps, look = schedule(t_end, tau)
    paths = integrate_batch(
        systems["henon_heiles"], tableau, t_end=steps * tau, steps=np.full(len(start), steps), samples=2,
        width=WIDTH, every_step=False, look=look, start=start,
    )  # fmt: skip
    errors = np.sort(paths.max_energy_error.reshape(surfaces, -1), axis=1)
    ranks = [max(1, ceil(q * errors.shape[1])) - 1 for q in QUANTILES]
    return EnsembleResult(
        escaped=(paths.left_at.reshape(surfaces, -1) > 0).mean(axis=1),
        quantiles=errors[:, ranks],
        steps=steps,
        evaluations=int(paths.evaluations.sum()),
    )


def run(tableau: Tableau, settings: EnsembleSettings) -> xr.Dataset:
    """Fraction escaped and energy error of one method over (energy, tau_per_stage)."""
    import xarray as xr

    start, grid, t_end = starts(settings), settings.grid(), Fraction(settings.t_end)
    rows = [integrate_ensemble(tableau, tau * tableau.stages, t_end, start, len(settings.energies)) for tau in grid]
    table = {
        "escaped": (np.array([r.escaped for r in rows]), "fraction of the trajectories that left their energy surface"),
        "energy_error": (
            np.array([r.quantiles for r in rows]),
            f"quantile of the largest |H - H0|/|H0| over {LOOKS} or more evenly spaced instants, inf if escaped",
        ),
        "steps": (np.array([r.steps for r in rows]), "steps of a run that does not escape"),
        "evaluations": (np.array([r.evaluations for r in rows]), "force evaluations of all trajectories and surfaces"),
    }
    dims = ("tau_per_stage", "energy", "quantile")
    return xr.Dataset(
        {k: (dims[: v.ndim], v, {"units": "1", "long_name": text}) for k, (v, text) in table.items()},
        coords={
            "tau_per_stage": ("tau_per_stage", [float(t) for t in grid], _named("1", "step size per stage")),
            "energy": ("energy", [float(Fraction(e)) for e in settings.energies], _named("1", "energy H0")),
            "quantile": ("quantile", list(QUANTILES), _named("1", "fraction of the trajectories that err less")),
        },
    ).transpose("energy", "tau_per_stage", "quantile")


def trusted_up_to(cube: xr.Dataset) -> xr.DataArray:
    """The step size per stage below which, over the grid, no more than :data:`TOLERATED` escapes; NaN if there is none.

    ``cube`` has ``escaped`` over tau_per_stage and any other dimensions.
    """
    kept = (cube.escaped <= TOLERATED).cumulative("tau_per_stage").min().astype(bool)
    limit: xr.DataArray = cube.tau_per_stage.where(kept).max("tau_per_stage")
    return limit.assign_attrs(_named("1", f"largest step size per stage up to which at most {TOLERATED:g} escapes"))


def _named(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}
