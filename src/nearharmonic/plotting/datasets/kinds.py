"""Kinds of results and the plots of each, separate from matplotlib, which the library runs without."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import bad_setting

if TYPE_CHECKING:
    import xarray as xr

MEMBER = "member"
#: Contents of a Dataset, by which its plots are found.
PROFILE, TRAJECTORY, CUBE, ENSEMBLE = "energy errors over tau", "a trajectory", "a cube", "an ensemble"
SECTION, RANKING = "a section", "a recommendation"
DEVIATIONS, MANY_DEVIATIONS = "deviations from an orbit", "deviations from several orbits"
#: What may be drawn of each kind of Dataset, the default first; "" is a trajectory's energy error above its orbit.
KINDS = {
    PROFILE: ("energy", "work"), CUBE: ("energy",), ENSEMBLE: ("energy",), SECTION: ("section",), RANKING: ("work",),
    TRAJECTORY: ("", "energy", "orbit", "phase"), DEVIATIONS: ("chaos", "orbit", "phase"), MANY_DEVIATIONS: ("chaos",),
}  # fmt: skip


def kind_of(dataset: Any) -> str:
    """Return the kind of a Dataset, "" for a Dataset of another origin."""
    dims, attributes, variables = (getattr(dataset, name, ()) for name in ("dims", "attrs", "variables"))
    if not hasattr(dataset, "data_vars"):
        return ""
    if "lyapunov_exponent" in variables and "t" in variables:
        return MANY_DEVIATIONS if MEMBER in dims else DEVIATIONS
    if "max_energy_error" in variables:
        named = "integrator" in attributes
        for holds, kind in (
            ({"integrator", "tau_per_stage"} <= set(dims), CUBE), (named and "tau" in dims, PROFILE),
            (named and MEMBER in dims, ENSEMBLE),
        ):  # fmt: skip
            if holds:
                return kind
    if "crossing" in dims and "surface" in variables:
        return SECTION
    if "rank" in dims and {"evaluations", "time"} <= set(variables):
        return RANKING
    return TRAJECTORY if "integrator" in attributes and {"t", "q", "p", "energy_error"} <= set(variables) else ""


def check_measured(given: Sequence[xr.Dataset]) -> None:
    """Raise SettingError if a Dataset has no measured energy errors."""
    if any(one.attrs.get("energy") == "none" for one in given):
        allowed = "there are no energy errors to draw; run with energy='every' or 'samples'"
        raise bad_setting("datasets", "energy='none'", allowed)
