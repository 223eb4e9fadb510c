"""Purposes of trained methods."""

from __future__ import annotations

from collections.abc import Collection
from math import pi

from nearharmonic_studies.trained.problems.purpose import (
    BOUND,
    MODERATE,
    SMALL,
    THERMAL,
    WEAK,
    Chain,
    CrystalPurpose,
    CubicPurpose,
    OscillatorPurpose,
    PreciseCubicPurpose,
    PrecisePurpose,
    Purpose,
)


def evaluations_an_orbit(*counts: int) -> tuple[float, ...]:
    """Return step sizes over the cost of a step for numbers of force evaluations in 2 pi."""
    return tuple(2 * pi / count for count in counts)


#: SRKN 11b of Blanes & Moan (2002) leads to the best methods for random potentials, their SRKN 14a to those for orbits.
_ELEVEN, _TWELVE = Chain(first="kick", stages=(11,)), Chain(first="kick", stages=(11, 12))
_FOURTEEN = Chain(first="drift", stages=(14, 15, 16), order=6)


def _perturbed(generalised_order: tuple[int, ...], *stages: int) -> Chain:
    """Return the families of a method for exactly solved oscillators; all good ones found have kicks first."""
    return Chain(first="kick", stages=stages, generalised_order=generalised_order)


_ALL = (
    Purpose(
        name="coarse", what="few evaluations", tau_per_stage=(0.15, 0.185, 0.235), t_end=60.0, after="light",
        chains=(Chain(first="kick", stages=(6, 7, 8)), _ELEVEN),
    ),
    Purpose(
        name="light", what="low accuracy", tau_per_stage=(0.1, 0.125, 0.155), t_end=50.0, after="moderate",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="moderate", what="moderate accuracy", tau_per_stage=(0.064, 0.08, 0.102), t_end=50.0, chains=(_TWELVE,)
    ),
    Purpose(name="fine", what="high accuracy", tau_per_stage=(0.041, 0.051, 0.065), t_end=40.0, chains=(_TWELVE,)),
    Purpose(
        name="finer", what="higher accuracy", tau_per_stage=(0.027, 0.034, 0.042), t_end=30.0, after="fine",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="finest", what="highest accuracy", tau_per_stage=(0.0175, 0.022, 0.0275), t_end=20.0, after="finer",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="precise", what="errors of 1e-12", tau_per_stage=(0.0115, 0.014, 0.0175), t_end=14.0,
        chains=(Chain(first="kick", stages=(17,), order=6),),
    ),
    Purpose(
        name="weak", what="small anharmonicity", tau_per_stage=(0.085, 0.11, 0.14), t_end=50.0, band=WEAK,
        chains=(Chain(first="kick", stages=(8, 9), harmonic_order=6),),
    ),
    CrystalPurpose(
        name="crystal_coarse", what="crystals, few evaluations", tau_per_stage=(0.33, 0.4, 0.5), t_end=60.0,
        band=THERMAL, chains=(Chain(first="kick", stages=(5, 6)),),
    ),
    CubicPurpose(
        name="cubic", what="cubic potentials, high accuracy", tau_per_stage=(0.035, 0.042, 0.05), t_end=40.0,
        band=BOUND, chains=(Chain(first="kick", stages=(11,), order=6, potential_degree=3),),
    ),
    PreciseCubicPurpose(
        name="cubic_precise", what="cubic potentials, errors of 1e-13", tau_per_stage=(0.0125, 0.016, 0.02),
        t_end=20.0, band=BOUND, chains=(Chain(first="drift", stages=(15,), order=8, potential_degree=3),),
    ),
    PrecisePurpose(
        name="quartic_precise", what="quartic potentials, errors of 1e-13", tau_per_stage=(0.0115, 0.014, 0.0175),
        t_end=14.0, chains=(Chain(first="kick", stages=(19,), order=8, potential_degree=4),),
    ),
    OscillatorPurpose(
        name="exact_coarse", what="oscillators solved exactly, few evaluations", tau_per_stage=(0.165, 0.2, 0.25),
        t_end=60.0, band=SMALL, descent="gauss_newton",
        chains=(_perturbed((8, 4), 7), _perturbed((6, 4), 11)),
    ),
    OscillatorPurpose(
        name="exact_light", what="oscillators solved exactly, low accuracy", tau_per_stage=(0.09, 0.11, 0.14),
        t_end=50.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((6, 4), 11),),
    ),
    OscillatorPurpose(
        name="exact_fine", what="oscillators solved exactly, high accuracy", tau_per_stage=(0.05, 0.06, 0.075),
        t_end=30.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((8, 4), 11),),
    ),
    OscillatorPurpose(
        name="exact_finer", what="oscillators solved exactly, higher accuracy", tau_per_stage=(0.028, 0.034, 0.042),
        t_end=30.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((8, 4), 11, 12, 13),),
    ),
    Purpose(
        name="orbits", what="planetary orbits", tau_per_stage=evaluations_an_orbit(480, 340, 240), t_end=8 * pi,
        band=None, chains=(_FOURTEEN,),
    ),
    Purpose(
        name="orbits_coarse", what="planetary orbits, few evaluations", band=None, t_end=10 * pi,
        tau_per_stage=evaluations_an_orbit(120, 85, 60), chains=(Chain(first="kick", stages=(11, 12, 13)),),
    ),
    Purpose(
        name="modified", what="planetary orbits, kicks of a modified potential", band=None, t_end=10 * pi,
        tau_per_stage=evaluations_an_orbit(150, 110, 75),
        chains=(
            Chain(first="drift", stages=(5, 6), squares=(0, 1, 2)),
            Chain(first="kick", stages=(5, 6), squares=(0, 1)),
        ),
    ),
)  # fmt: skip
#: All purposes by name, and the names of those whose methods are registered.
PURPOSES = {one.name: one for one in _ALL}
REGISTERED = tuple(name for name, one in PURPOSES.items() if one.registered)


def trained_before(purpose: str, trained: Collection[str]) -> list[str]:
    """Return the purpose whose method is an additional start, if it is ``trained``."""
    after = PURPOSES[purpose].after
    return [after] if after is not None and after in trained else []
