"""Reductions over the problems: the best method of each idea, its gain, and the best idea.

The dataset has ``log_error`` over (integrator, tau_per_stage, strength, problem) with the coordinate ``idea`` of each
integrator, ``exact_log_error`` over (exact_integrator, ...), ``anharmonicity`` over (strength, problem), and the
attribute ``seed``, which chooses the resamples. With ``over="resample"`` a reduction takes the errors of the best in
place of those of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.output.store import coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic.training.published import TRAINED
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.trained.contestants import EXACT_IDEAS, IDEAS
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.resampling import (
    CONFIDENCE,
    RESAMPLES,
    anharmonicity_quantiles,
    interval,
    resampled_means,
)
from nearharmonic_studies.trained.run import CHARGE

reduction = Reductions()

#: Reference idea.
REFERENCE = "general"


@reduction("anharmonicity", over="problem")
def anharmonicity(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the potentials of their anharmonicity."""
    return anharmonicity_quantiles(runs, "potentials")


@reduction("log_error", "exact_log_error", "idea", over="problem")
def best_of_ideas(runs: xr.Dataset, resamples: int = RESAMPLES) -> xr.Dataset:
    """Best method of each idea and its mean error, and the errors of the best, chosen anew, in each resample."""
    exact = runs.exact_log_error.rename(exact_integrator="integrator")
    trained = exact.integrator.str.startswith(TRAINED).values
    ideas = {idea: exact.isel(integrator=one) for idea, one in zip(EXACT_IDEAS, (~trained, trained), strict=True)}
    split = [idea for idea in IDEAS if idea not in EXACT_IDEAS]
    ideas |= {idea: runs.log_error.isel(integrator=np.flatnonzero(runs.idea == idea)) for idea in split}
    parts = []
    for idea, errors in ideas.items():
        if errors.sizes["integrator"]:
            means = errors.mean("problem", skipna=False)
            again = resampled_means(errors, runs.attrs["seed"], resamples)
            best = {"mean_log_error": means.min("integrator"), "best_method": means.idxmin("integrator")}
            parts.append(xr.Dataset(best | {"resampled": again.min("integrator")}).expand_dims(idea=[idea]))
    found = xr.concat(parts, "idea", coords="minimal", compat="override").reindex(
        idea=list(IDEAS), fill_value={"best_method": ""}
    )
    for name, text in (
        ("mean_log_error", "mean over the potentials of log10 max |dH/H0|, best method of an idea"),
        ("best_method", "best method of an idea; empty if it has none"),
    ):
        found[name] = found[name].assign_attrs(described(text))
    meaning = f"what methods are built on; {' and '.join(EXACT_IDEAS)} cost {CHARGE} an evaluation"
    return found.assign_coords(coordinate("idea", list(IDEAS), meaning))


@reduction("mean_log_error", "resampled", over="resample")
def gains(best: xr.Dataset) -> xr.Dataset:
    """Gain of each idea over the reference, with its interval."""
    gain, resampled = (one.sel(idea=REFERENCE, drop=True) - one for one in (best.mean_log_error, best.resampled))
    over = ("idea", "tau_per_stage", "strength")
    ends, text = interval(resampled).transpose(*over, "bound"), f"gain over the best method of {REFERENCE}"
    return xr.Dataset({
        "gain": gain.transpose(*over).assign_attrs(described(text, "decades")),
        "gain_interval": ends.assign_attrs(described(f"its {CONFIDENCE:.0%} interval", "decades")),
    })  # fmt: skip


@reduction("mean_log_error", "resampled", over="resample")
def exact_gains(best: xr.Dataset) -> xr.Dataset:
    """Gain of trained methods over all others with the oscillator solved exactly, with its interval."""
    gain, resampled = (
        one.sel(idea=EXACT_IDEAS[0], drop=True) - one.sel(idea=EXACT_IDEAS[1], drop=True)
        for one in (best.mean_log_error, best.resampled)
    )
    text = f"gain of the best method of {EXACT_IDEAS[1]} over the best of {EXACT_IDEAS[0]}"
    return xr.Dataset({
        "exact_gain": gain.assign_attrs(described(text, "decades")),
        "exact_gain_interval": interval(resampled).assign_attrs(described(f"its {CONFIDENCE:.0%} interval", "decades")),
    })  # fmt: skip


@reduction("mean_log_error", "resampled", over="resample")
def leaders(best: xr.Dataset) -> xr.Dataset:
    """Idea that is ahead, and its lead over the second with its interval: among all ideas, and for T and V."""
    split = _leaders(best.drop_sel(idea=list(EXACT_IDEAS)), "_split", f"the same without {' and '.join(EXACT_IDEAS)}")
    return _leaders(best, "", "idea with the least mean error").assign(split)


def _leaders(best: xr.Dataset, suffix: str, text: str) -> xr.Dataset:
    errors = best.mean_log_error.fillna(np.inf)
    leader = errors.idxmin("idea")
    second = errors.where(errors.idea != leader).idxmin("idea")
    lead, resampled = (
        one.sel(idea=second).drop_vars("idea") - one.sel(idea=leader).drop_vars("idea")
        for one in (best.mean_log_error, best.resampled)
    )
    ends = interval(resampled)
    return xr.Dataset({
        f"leader{suffix}": leader.assign_attrs(described(text)),
        f"lead{suffix}": lead.assign_attrs(described("by which it is ahead of the second", "decades")),
        f"lead{suffix}_interval": ends.assign_attrs(described("its 95 % interval", "decades")),
    })  # fmt: skip


CAPTION = (
    "Random potentials of two coordinates: the idea whose best method has the least mean of log10 max |dH/H0| at equal "
    "cost, by how many decades it is ahead of the second with its 95 % interval over the potentials; the idea that is "
    "ahead with T and V, where oscillators are not solved exactly; the gain of trained over all other methods where "
    "they are; and the gains of all over the best general method. "
    "Anharmonicity is the median variation of the Hessian."
)


def ideas_table(cube: xr.Dataset) -> Table:
    """Return a row for each step size and strength."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["tau_per_stage", "anharmonicity", "ahead", "method", "log10_error", "lead", "lead_low", "lead_high"]
    header += ["ahead with T + V", "lead with T + V", "exact_gain", "exact_gain_low", "exact_gain_high"]
    rows: list[list[Any]] = []
    for t, j in product(range(len(values["tau_per_stage"])), range(len(values["strength"]))):
        leader = str(values["leader"][t, j])
        i = IDEAS.index(leader)
        numbers = [values["mean_log_error"][i, t, j], values["lead"][t, j], *values["lead_interval"][t, j]]
        first = [float(values["tau_per_stage"][t]), float(values["anharmonicity"][j, 1]), leader]
        best = str(values["best_method"][i, t, j])
        split = [str(values["leader_split"][t, j]), float(values["lead_split"][t, j])]
        split += [float(values["exact_gain"][t, j]), *map(float, values["exact_gain_interval"][t, j])]
        rows.append([*first, best, *map(float, numbers), *split, *map(float, values["gain"][:, t, j])])
    return Table(header=[*header, *IDEAS], rows=rows, caption=CAPTION)


def reduce(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of ideas over step size and strength, and the ``table`` of which is ahead, from ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    best = reduction.of(read(run).assign_attrs(seed=settings.seed), over="problem")
    cube = best.drop_dims("resample").assign(reduction.of(best, over="resample"))
    return {"cube": cube, "table": ideas_table(cube)}
