"""Runs of systems whose V is a function of numba: settings that they refuse, and the floor of their energy errors."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.numba.potential import numba_potential

#: An energy error of at most so many times the floor is near it.
NEAR_FLOOR = 10.0
#: Members of an ensemble whose floors are measured, at most.
MEMBERS = 8


def check_precision(system: System, precisions: Sequence[str], key: str = "precision") -> None:
    """Raise an error for extended precision with a V that is computed in doubles.

    Raises
    ------
    SettingError
        It names the setting ``key``.
    """
    if "extended" in precisions and numba_potential(system) is not None:
        needed = f"V of {system.name} is a function of numba, which computes in double precision"
        raise bad_setting(key, "extended", needed)


def energy_floor(system: System, scale: float, start: Floats, parameters: Floats, H0: Floats) -> dict[str, float]:
    """Return the attribute ``energy_floor`` of results; none unless V is a function of numba.

    It is the rounding noise of V relative to what energy errors are relative to; of several runs the largest of the
    first :data:`MEMBERS`.

    Parameters
    ----------
    system : System
        A system of d coordinates.
    scale : float
        Energy that errors are relative to; 0 for |H0|.
    start : (R or 1, 4 d) array of float
        Initial states.
    parameters : (R or 1, 2 P) array of float
        Parameters, in pairs.
    H0 : (R,) array of float
        Initial energies.
    """
    potential = numba_potential(system)
    if potential is None:
        return {}
    from nearharmonic.systems.numba.gradients import rounding_noise

    d, largest = system.dimension, 0.0
    for i, energy in enumerate(H0[:MEMBERS].tolist()):
        if not isfinite(energy):
            continue
        row, given = (rows[i if len(rows) > 1 else 0] for rows in (start, parameters))
        noise = rounding_noise(potential, row[:d].tolist(), given[::2].tolist(), energy)
        largest = max(largest, noise / (scale or abs(energy) or 1.0))
    return {"energy_floor": largest}


def floor_in_words(floor: float) -> str:
    """Return the sentence about energy errors near a floor."""
    return f"near {floor:.1e}, the rounding of V, which is computed in doubles: no method makes such an error smaller"
