"""Declaration of the stress tests."""

from typing import Any

from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability.settings import StabilitySettings
from nearharmonic_paper.tasks.experiment import Experiment, Figure

#: Title, cube and caption of each figure, by the name of its function.
DRAWN = {
    "linear_stability": (
        "Linear stability",
        "linear_stability",
        (
            "Half the trace of the step matrix of the harmonic oscillator, a polynomial in τ known exactly, against "
            "step size per stage τ/s. The thin line is cos(τ), the half trace of the exact flow. A method is "
            "stable while its curve stays between -1 and 1. Red marks the gaps where it does not, and ticks at the top "
            "mark gaps too narrow to be seen. Each panel states the first edge τ* and the largest growth per step in "
            "the first gap. Past the last edge every method is unstable."
        ),
    ),
    "henon_heiles_stability": (
        "Ensembles of the Hénon-Heiles system by energy",
        "stability_henon_heiles",
        (
            "Ensembles of the Hénon-Heiles system. Each method has four strips, one per energy surface, from H = 1/24 "
            "(top) to the energy of escape, H = 1/6 (bottom), against step size per stage. Colour is the median over "
            "trajectories of the maximum energy error, lighter is better. Grey: more than 1 % of the trajectories left "
            "their energy surface. Dark streaks are step-size resonances. Most lie below the first linear limit (black "
            "line), where the first gap opens in which the harmonic oscillator is unstable; it is often narrower than "
            "a column. Initial conditions are quasi-random in the microcanonical measure."
        ),
    ),
    "kepler_stability": (
        "Kepler orbits by eccentricity",
        "stability_kepler",
        (
            "Kepler orbits of eccentricity e from the apoapsis, one map per method, against force evaluations per "
            "orbit; lighter is better. A: maximum energy error. B: spurious advance of the perihelion in radians per "
            "orbit. Grey: orbit lost, because the energy error reached the energy itself or the perihelion turned by "
            "more than a quarter turn in an orbit. White line: energy error 10⁻⁶. C: the white lines of all methods. "
            "The eccentricity is spaced by the logarithm of the perihelion distance, 1 - e."
        ),
    ),
    "rounding_growth": (
        "Growth of rounding errors",
        "stability_rounding",
        (
            "Effect of rounding alone on Kepler orbits over a long time, as root mean square over an ensemble. A: "
            "energy. B: lag along the track, as mean anomaly. Solid: plain summation. Dashed: compensated. "
            "Dash-dotted: extended precision. Dotted: the lag, proportional to time, that coefficients rounded to "
            "double cause in exact arithmetic; no summation removes it. Grey: Brouwer's law for independent errors, "
            "√t and t√t. C, D: fitted exponents, with 95 % intervals by the jackknife over orbits."
        ),
    ),
    "kinetic_energy": (
        "Kinetic energy that is not quadratic",
        "kinetic_energy",
        (
            "Relativistic oscillator, H = √(1 + p²) - 1 + q²/2, t in [0, 500], from q = A at rest. A, B: maximum "
            "energy error against step size per stage, at a small and at a relativistic amplitude. C: the error at "
            "τ/s = 0.05 relative to Ruth's method, against amplitude. The lead of the harmonic methods shrinks as T "
            "departs from p²/2. D: C with the roles of T and V exchanged, which moves the departure into V and leaves "
            "T quadratic. A lead that C loses and D keeps depends on the shape of T alone. Filled markers: Nielsen "
            "(2015)."
        ),
    ),
}
FIGURES = {
    name: Figure(
        draw=f"nearharmonic_paper.experiments.stability.figures:{name}",
        title=title, cube=cube, caption=caption, category="Stability",
    )
    for name, (title, cube, caption) in DRAWN.items()
}  # fmt: skip
ENSEMBLES = ("henon_heiles", "kepler", "rounding")


def intervals(config: Any) -> dict[str, str]:
    """Return the end of the interval of each autonomous system, from the config or else from the system.

    Regularised systems are left out, since their phase space is not the one of their states.
    """
    own = {n: one.t_end for n, one in systems.items() if not one.time_dependent and one.regularisation is None}
    return own | {sweep.system: sweep.t_end for sweep in config.sweeps if sweep.system in own}


EXPERIMENT = Experiment(
    name="stability",
    title="Stability",
    about="Linear stability limits, ensembles, Kepler orbits, round-off, conserved structure, T other than p²/2.",
    place=4,
    duration="70 s",
    settings=StabilitySettings,
    effect="Stress tests of the methods by `stability`",
    cubes={
        "linear_stability": (
            "integrator, tau_per_stage, gap",
            "`half_trace` of the oscillator's step matrix; `start` and `end` of the gaps in which a method is "
            "unstable, and the growth in them",
        ),
        "structure": (
            "system, integrator",
            "symplectic defect of the tangent map, distance from the start after a run and the run back, and drift of "
            "the energy, each with the value that rounding alone gives",
        ),
        "kinetic_energy": (
            "roles, amplitude, integrator, tau_per_stage",
            "energy errors of the relativistic oscillator, with the roles of drift and kick exchanged as well",
        ),
        "stability_henon_heiles": (
            "integrator, energy, tau_per_stage, quantile",
            "`energy_error` and share `escaped` of ensembles on energy surfaces; `trusted_up_to`, the step size up to "
            "which at most 1 % escape",
        ),
        "stability_kepler": (
            "integrator, tau_per_stage, eccentricity",
            "`energy_error`, `perihelion_advance` and `orbits_kept` of Kepler orbits; `evaluations_for_contour`, the "
            "cost of an error of 10⁻⁶",
        ),
        "stability_rounding": (
            "integrator, source, orbit, sample",
            "`energy_error` and `lag` by rounding alone, their root mean squares, and exponents of their growth",
        ),
    },
    tables=(
        "linear_stability",
        "stability_henon_heiles",
        "stability_kepler",
        "stability_rounding",
        "structure",
        "kinetic_energy",
    ),
    figures=FIGURES,
    values=lambda config: {
        "ensemble": ENSEMBLES,
        "integrator": config.stepwise,
        "autonomous": intervals(config),
    },
    runs=("stability/{ensemble}/{integrator}", "stability/structure/{autonomous}", "stability/kinetic_energy"),
)
