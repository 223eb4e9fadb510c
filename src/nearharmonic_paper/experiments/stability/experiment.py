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
            "Half the trace of the step matrix of the harmonic oscillator, polynomials in tau known exactly, against "
            "step size per stage tau/s; cos(tau), the exact one, is the thin line. A method is stable while the curve "
            "stays between -1 and 1; red marks the gaps where it does not, ticks at the top those too narrow to be "
            "seen. The first edge tau* and the largest growth per step in the first gap are written in each panel. "
            "Past the last edge none is stable."
        ),
    ),
    "henon_heiles_stability": (
        "Ensembles on energy surfaces of Hénon and Heiles",
        "stability_henon_heiles",
        (
            "Henon-Heiles ensembles: for each method, four energy surfaces from H = 1/24 (top strip) to the energy of "
            "escape, H = 1/6 (bottom strip), against the step size per stage. Colour is the median over the "
            "trajectories of the largest energy error: the lighter the better. Grey: more than 1 % of the "
            "trajectories left their energy surface. Dark streaks are step-size resonances; most lie below the first "
            "linear limit (black line), where the first gap opens in which the harmonic oscillator is unstable, often "
            "narrower than a column. Initial conditions are quasi-random in the microcanonical measure."
        ),
    ),
    "kepler_stability": (
        "Kepler orbits by eccentricity",
        "stability_kepler",
        (
            "Kepler orbits of eccentricity e from the apoapsis. A: largest energy error; B: spurious advance of the "
            "perihelion in radians per orbit; each against force evaluations per orbit, one map a method, the lighter "
            "the better. Grey: the orbit was lost (the energy error reached the energy itself, or the perihelion "
            "turned by more than a quarter turn in an orbit). White line: energy error 1e-6. C: that line for all "
            "methods. The eccentricity is spaced by the logarithm of the perihelion distance, 1 - e."
        ),
    ),
    "rounding_growth": (
        "Growth of rounding errors",
        "stability_rounding",
        (
            "Effect of rounding alone on Kepler orbits over a long time, as root mean square over an ensemble. A: "
            "energy; B: lag along the track, as mean anomaly. Solid: plain summation; dashed: compensated; "
            "dash-dotted: extended precision; dotted: the lag that coefficients rounded to double cause in exact "
            "arithmetic, proportional to time, which no summation removes. Grey: Brouwer's law for independent "
            "errors, t^1/2 and t^3/2. C, D: the exponents fitted, with 95 % intervals by the jackknife over orbits."
        ),
    ),
    "kinetic_energy": (
        "A kinetic energy that is not quadratic",
        "kinetic_energy",
        (
            "Relativistic oscillator, H = sqrt(1 + p^2) - 1 + q^2/2, t in [0, 500], from q = A at rest. A, B: largest "
            "energy error over every step against step size per stage, at a small and at a relativistic amplitude. C: "
            "the same at tau/s = 0.05 against amplitude, over that of Ruth's method: the lead of the harmonic methods "
            "shrinks as T departs from p^2/2. D: the same with the roles of T and V exchanged, which puts the "
            "departure into V and leaves T quadratic; what C loses and D keeps is due to the shape of T alone. Filled "
            "markers: Nielsen (2015)."
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
    """Return the end of the interval of each autonomous system: that of the config, or else that of the system.

    A regularised system is integrated in another phase space than that of its states, and left out.
    """
    own = {n: one.t_end for n, one in systems.items() if not one.time_dependent and one.regularisation is None}
    return own | {sweep.system: sweep.t_end for sweep in config.sweeps if sweep.system in own}


EXPERIMENT = Experiment(
    name="stability",
    title="Stability",
    about="Linear limits, ensembles, Kepler maps, round-off growth, structure, T not quadratic.",
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
            "the energy, each beside what rounding gives",
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
