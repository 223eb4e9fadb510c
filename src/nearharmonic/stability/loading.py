"""The section ``stability`` of a config, from YAML to checked settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from nearharmonic.config import Schema, load, with_defaults
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.settings import MOST_STEPS, checked_t_end
from nearharmonic.stability.initial_conditions import ESCAPE_ENERGY
from nearharmonic.stability.settings import EnsembleSettings, MapSettings, RoundingSettings
from nearharmonic.tableau import Tableau

#: Step sizes of one map.
MOST_POINTS = 10**4
#: Force evaluations of one ensemble, all methods together: some minutes.
MOST_EVALUATIONS = 10**12

Section = Mapping[str, Any]


def load_stability(mapping: Mapping[str, Any], schema: Schema) -> dict[str, Any]:
    """The settings of each ensemble, by the name of its key below ``stability`` in the config ``mapping``.

    Raises:
        NearharmonicError: the first fault found, in this section or elsewhere in the config.
    """
    methods = [integrators[name] for name in load(mapping, schema).integrators]
    section = with_defaults(mapping, schema)["stability"]
    return {item: check(section[item], methods) for item, check in _CHECKS.items()}


def ensemble_settings(asked: Section, methods: Sequence[Tableau]) -> EnsembleSettings:
    """The part ``henon_heiles`` of the section, its defaults filled in.

    Raises:
        SettingError: a value outside what is allowed, or more evaluations than a machine can do.
    """
    here = "stability.henon_heiles"
    grid = {key: checked_t_end(value, f"{here}.tau_per_stage.{key}") for key, value in asked["tau_per_stage"].items()}
    settings = EnsembleSettings(
        trajectories=asked["trajectories"],
        energies=tuple(_energy(text, f"{here}.energies[{i}]") for i, text in enumerate(asked["energies"])),
        t_end=checked_t_end(asked["t_end"], f"{here}.t_end"),
        seed=asked["seed"],
        **grid,
    )
    if Fraction(grid["highest"]) < Fraction(grid["lowest"]):
        key, allowed = f"{here}.tau_per_stage.highest", f"a finite number, at least lowest = {grid['lowest']}"
        raise bad_setting(key, asked["tau_per_stage"]["highest"], allowed)
    points = int((Fraction(grid["highest"]) - Fraction(grid["lowest"])) / Fraction(grid["spacing"])) + 1
    if points > MOST_POINTS:
        allowed = f"the grid would have {points} step sizes, and may have {MOST_POINTS}"
        raise bad_setting(f"{here}.tau_per_stage.spacing", asked["tau_per_stage"]["spacing"], allowed)
    each = sum(float(settings.t_end) / float(tau) for tau in settings.grid())
    _affordable(f"{here}.trajectories", each * len(settings.energies) * len(methods), settings.trajectories)
    return settings


def map_settings(asked: Section, methods: Sequence[Tableau]) -> MapSettings:
    """The part ``kepler`` of the section, its defaults filled in.

    Raises:
        SettingError: a value outside what is allowed, or more evaluations than a machine can do.
    """
    here = "stability.kepler"
    evaluations = asked["evaluations_per_orbit"]
    fewest = float(checked_t_end(evaluations["lowest"], f"{here}.evaluations_per_orbit.lowest"))
    most = float(checked_t_end(evaluations["highest"], f"{here}.evaluations_per_orbit.highest"))
    if most < fewest:
        key, allowed = f"{here}.evaluations_per_orbit.highest", f"a finite number, at least lowest = {fewest:g}"
        raise bad_setting(key, evaluations["highest"], allowed)
    if most * asked["orbits"] > MOST_STEPS:
        key, allowed = f"{here}.orbits", f"one run may take {MOST_STEPS:.0e} evaluations"
        raise bad_setting(key, asked["orbits"], allowed)
    each = most * asked["orbits"] * (1 + evaluations["points_per_decade"] / 2.3)
    _affordable(f"{here}.eccentricities", each * len(methods), asked["eccentricities"])
    return MapSettings(
        eccentricities=asked["eccentricities"],
        highest_eccentricity=float(asked["highest_eccentricity"]),
        orbits=asked["orbits"],
        fewest=fewest,
        most=most,
        points_per_decade=evaluations["points_per_decade"],
    )


def rounding_settings(asked: Section, methods: Sequence[Tableau]) -> RoundingSettings:
    """The part ``rounding`` of the section, its defaults filled in.

    Raises:
        SettingError: a value outside what is allowed, or more evaluations than a machine can do.
    """
    here = "stability.rounding"
    if asked["steps"] < 20 * asked["evaluations_per_orbit"]:
        allowed = "at least 20 times the evaluations per orbit: growth is fitted over more than a decade of time"
        raise bad_setting(f"{here}.steps", asked["steps"], allowed)
    # In double-double, three times; it costs about eight times a double.
    each = asked["steps"] * 24 * sum(tableau.stages for tableau in methods)
    _affordable(f"{here}.ensemble", each, asked["ensemble"])
    return RoundingSettings(**asked)


def _energy(text: object, key: str) -> str:
    allowed = f"a quotient or decimal above 0 and at most {ESCAPE_ENERGY}, such as 1/8"
    try:
        energy = Fraction(str(text))
    except (ValueError, ZeroDivisionError):
        raise bad_setting(key, text, allowed) from None
    if not 0 < energy <= ESCAPE_ENERGY:
        raise bad_setting(key, text, allowed)
    return str(energy)


def _affordable(key: str, each: float, count: int) -> None:
    if each * count > MOST_EVALUATIONS:
        allowed = f"it would take {each * count:.2g} force evaluations, and may take {MOST_EVALUATIONS:.0e}"
        raise bad_setting(key, count, allowed)


_CHECKS: dict[str, Callable[[Section, Sequence[Tableau]], Any]] = {
    "henon_heiles": ensemble_settings,
    "kepler": map_settings,
    "rounding": rounding_settings,
}
