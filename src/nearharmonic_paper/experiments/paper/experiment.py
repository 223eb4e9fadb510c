"""The paper's experiment, which the default target makes: settings of each system, figures, and other results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from math import isfinite
from typing import Annotated, Any, Literal

from nearharmonic.numerics.written import ALL_DIGITS, decimal, decimal_of
from nearharmonic_paper import entries
from nearharmonic_paper.entries import AT_LEAST_LOWEST, POSITIVE, STRICT, Reading, setting
from nearharmonic_paper.tasks.experiment import Experiment, Figure

Precision = Literal["double", "extended"]
Summation = Literal["compensated", "plain"]
Split = Literal["kinetic_potential", "exact_oscillator"]

#: Cubes of orbits that only a config with a system of the paper has.
ORBITS = ("henon_heiles_chaos", "substeps_displaced")

FINITE = "a finite number, or a decimal string, which keeps all its digits"


def _exact_decimal(value: object) -> str:
    """Convert a finite number of any sign, or a decimal string, to a plain decimal string."""
    text = decimal(value)
    if not isinstance(text, str | Decimal):
        raise TypeError
    number = decimal_of(str(text))
    if not isfinite(float(number)):
        raise ValueError
    return str(number.normalize(ALL_DIGITS) or 0)


_NUMBER = (("type", ("number", "string")),)
#: A finite number or its decimal string, as a decimal string with all digits.
ExactDecimal = Annotated[str, Reading(_exact_decimal, _NUMBER)]
_OF_PARAMETER = (("description", "Value"), ("allowed", FINITE), ("unit", "the unit of the parameter"))
ParameterValue = Annotated[str, Reading(_exact_decimal, (*_NUMBER, *_OF_PARAMETER))]


@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """A grid of logarithmically spaced step sizes per stage."""

    __pydantic_config__ = STRICT

    lowest: entries.PositiveNumber = setting("First step size per stage", POSITIVE, unit="the system's unit of time")
    highest: entries.PositiveNumber = setting(
        "The grid ends at or just below this step size per stage", AT_LEAST_LOWEST, unit="the system's unit of time"
    )
    points_per_decade: int = setting("Step sizes in each factor of ten", **entries.whole_from(1, 10**9))


_START: Any = {
    "allowed": "a list of numbers, as many as the system has coordinates", "each": FINITE, "default": None,
    "min_length": 1,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SystemSettings:
    """Settings of one system."""

    __pydantic_config__ = STRICT

    file: str | None = setting(
        "Python file that defines SYSTEM, the system of this name; looked for from the working directory, then from "
        "the folder of the config",
        "the path of a Python file, for a name that is not registered",
        default=None,
    )
    system: str | None = setting(
        "Registered system that this one is, with other initial values or parameters",
        "the name of a registered system, for a name that is not registered",
        default=None,
    )
    label: str | None = setting(
        "Name of the system in titles; its own if not given",
        "a text of at most 100 characters, for a name that is not registered",
        default=None, min_length=1, max_length=100,
    )  # fmt: skip
    q0: tuple[ExactDecimal, ...] | None = setting(
        "Initial position; the system's own if not given", unit="the system's unit of q", **_START
    )
    p0: tuple[ExactDecimal, ...] | None = setting(
        "Initial momentum; the system's own if not given", unit="the system's unit of p", **_START
    )
    energy: ExactDecimal | None = setting(
        "Energy at the start: the initial momentum is multiplied by the factor that gives it",
        FINITE, unit="the system's unit of energy", default=None,
    )  # fmt: skip
    parameters: Mapping[str, ParameterValue] | None = setting(
        "Parameters of the system that have other values than its own",
        "a mapping of names of parameters to numbers",
        unit="the unit of the parameter", each=FINITE, default=None,
    )  # fmt: skip
    tau_per_stage: StepSizes = setting(
        "The step sizes, divided by the number of stages so that equal values cost equal work"
    )
    t_end: entries.PositiveDecimal | None = setting(
        "End of the interval [0, t_end] that every run covers exactly; the system's own if not given",
        POSITIVE, unit="the system's unit of time (sho and henon_heiles 1, kepler h)", default=None,
    )  # fmt: skip
    precision: tuple[Precision, ...] = setting(
        "Arithmetic of the runs; beside double, sho runs extended only where the double curve nears its rounding floor",
        "a list of double, extended or both", each="one of double, extended", default=("double",), min_length=1,
    )  # fmt: skip
    split: Split | None = setting(
        "Parts of H that drifts and kicks solve: T and V, if not given; or T with the oscillators whose frequencies "
        "the system declares, and the rest of V",
        "one of kinetic_potential, exact_oscillator, for a name that is not registered",
        default=None,
    )


#: A figure of energy errors.
_PROFILE: Any = {"draw": "nearharmonic.plotting.style:draw_profile", "profile": True}

#: The figures of the gain over Ruth's method.
_GAIN: Any = {
    "draw": "nearharmonic_paper.experiments.paper.figures:gain", "cubes": ("henon_heiles", "kepler"), "method": "ruth",
    "column": {"narrow": True}, "caption": (
        "Energy error of Ruth's method divided by the error of each method at the same step size per stage τ/s, which "
        "means equal cost. At 100 the error is 100 times smaller than Ruth's. Bold curves are the methods of Nielsen "
        "(2015) and methods found here. They gain orders of magnitude on the Hénon-Heiles system, which is nearly "
        "harmonic, and much less on the eccentric Sun-Mercury system. Yosh s7o6 A has order six, so its gain grows as "
        "steps shrink. Each point is two whole runs in double precision. A curve ends on the left where an error is "
        "below 2 × 10⁻¹⁵, near the rounding of a double, and on the right where Ruth's error exceeds 1 %."
    ),
}  # fmt: skip

FIGURES = {
    "gain": Figure(title="Maximum energy error against Ruth's at equal cost", **_GAIN),
    "gain_mean": Figure(
        title="Mean energy error against Ruth's at equal cost", settings={"variable": "mean_energy_error"},
        by_default=False, **_GAIN,
    ),
    "fig1_sho": Figure(
        title="Energy error of the oscillator", cube="sho", target="fig1", **_PROFILE,
        caption=(
            "Maximum (A) and mean (B) relative energy error of the simple harmonic oscillator over every step, t in "
            "[0, 500], against step size per stage τ/s. Each point is a whole run. Solid lines with markers: double "
            "precision, compensated summation. H is evaluated in double-double, from the state and its compensation, "
            "so these runs resolve errors below 10⁻¹⁶. Dashed: extended precision, with states in double-double too. "
            "Filled markers: methods of Nielsen (2015), which have slope 6 here and order 4 in general. The strip "
            "above a panel marks runs that diverged or are off the scale."
        ),
    ),
    "fig2_decomposition": Figure(
        draw="nearharmonic_paper.experiments.paper.figures:fig2_decomposition",
        title="Error terms of the harmonic oscillator", cube="sho_terms", target="fig2",
        caption=(
            "Position error terms of one step for the simple harmonic oscillator (Nielsen 2015, Eq. 17, "
            "dimensionless). A: κ by order λ, up to the highest order that a method's stages reach. Circles around the "
            "markers: ABA composition (outer row drifts q). Lines: BAB composition of the same coefficients (outer row "
            "kicks p). Both meet at even orders. The static figure has methods with a term above 1000 in an inset. B: "
            "orders whose term vanishes (below 10⁻³⁰ in multiprecision), as circle (ABA) and bar (BAB). The harmonic "
            "order of the position is the last order before the first gap."
        ),
    ),
    "fig3_henon_heiles": Figure(
        title="Energy error of the Hénon-Heiles system", cube="henon_heiles", target="fig3", **_PROFILE,
        caption=(
            "Maximum (A) and mean (B) relative energy error of the Hénon-Heiles system at H = 1/8 over every step, t "
            "in [0, 500], against step size per stage τ/s. Each point is a whole run in double precision with "
            "compensated summation. H is evaluated in double-double, which resolves errors below 10⁻¹⁶. At large "
            "steps, methods of higher harmonic order (filled markers) fall faster than order 4, as the system is close "
            "to an oscillator. The strip above a panel marks runs that diverged or are off the scale."
        ),
    ),
    "fig4_perihelion": Figure(
        draw="nearharmonic_paper.experiments.paper.figures:fig4_perihelion",
        title="Advance of the perihelion against force evaluations per orbit", cube="kepler", target="fig4",
        caption=(
            "Spurious advance of Mercury's perihelion against force evaluations per orbit, in radians per orbit (left) "
            "and arcseconds per century (right). It is the absolute rate of rotation of the Laplace-Runge-Lenz vector, "
            "by linear regression over the orbits of ten years. A dot is a run, and every few dots carry the method's "
            "marker. Bars show the 95 % interval of the fit where it exceeds the dot. A cross is a run whose interval "
            "includes zero. The dashed line is the advance that general relativity explains, 42.98 arcseconds per "
            "century. Grey at the top, above 0.1 rad per orbit: the path is far from an ellipse, and curves no longer "
            "follow the order of their method. Grey at the bottom, below 10⁻¹⁵ rad per orbit: rounding errors of "
            "doubles dominate."
        ),
    ),
    "fig5_kepler": Figure(
        title="Energy error of the Sun-Mercury system", cube="kepler", target="fig5", **_PROFILE,
        caption=(
            "Maximum (A) and mean (B) relative energy error of the planar Sun-Mercury system over every step in ten "
            "years (87 660 h), against step size per stage τ/s in hours. Each point is a whole run in double precision "
            "with compensated summation. H is evaluated in double-double, which resolves errors below 10⁻¹⁶. The error "
            "is largest at perihelion passages, so the two panels rank the methods differently. The strip above a "
            "panel marks runs that diverged or are off the scale."
        ),
    ),
    "fig6_substeps": Figure(
        draw="nearharmonic_paper.experiments.paper.figures:fig6_substeps", title="Substeps in phase space", cube=None,
        column={"across": 1}, target="fig6",
        caption=(
            "Substeps of two iterations in phase space (dimensionless) by Yosh s7o6 A (A, C) and BABs7o7H (B, D): the "
            "harmonic oscillator from (q, p) = (0, 1) with τ = π/4 (A, B), and the Hénon-Heiles system in the plane qₓ "
            "= pₓ = 0 from (0.4, 0.4) with τ = 2 (C, D). Circles and crosses are the initial and final position of "
            "each iteration. Dots are the states after each drift-kick pair, numbered in the first iteration. Red: the "
            "next drift goes backward. Green: the next kick. Green in red: both. Blue: neither. The thin line follows "
            "the drifts (horizontal) and kicks (vertical). Shades and contours are the Hamiltonian H, and the dashed "
            "contour passes through the start. Below each panel are the step size, the relative energy error after two "
            "iterations, and the largest after any of 1000, or the iteration at which the path leaves its energy "
            "surface. In D it stays on the surface in the plane only, as the figure on starts outside the plane shows."
        ),
    ),
    "fig6_displaced": Figure(
        draw="nearharmonic_paper.experiments.paper.figures:fig6_displaced",
        title="Panel (D) of Figure 6 outside its plane", cube="substeps_displaced",
        caption=(
            "Panel D of Figure 6 from starts outside its plane: BABs7o7H on the Hénon-Heiles system with τ = 2 from q "
            "= p = 0.4 along y, p = 0 along x, and qₓ = 0 or one of four other values, over 100 000 iterations with "
            "compensated (A) and plain sums (B). A curve is the maximum relative energy error since its previous "
            "point. In the plane qₓ = 0 the error stays bounded. From every other start, even qₓ = 10⁻¹², the "
            "path leaves its energy surface (cross, at |ΔH/H₀| = 1). Rounding decides at which iteration: the crosses "
            "of A and B differ, and the order of operations moves them too."
        ),
    ),
    "{system}_energy_error": Figure(
        title="Energy error", cube="{system}", **_PROFILE,
        caption=(
            "Maximum (A) and mean (B) relative energy error over every step of a run, against step size per stage τ/s. "
            "Each point is a whole run. Dashed lines, if any, are in extended precision. Filled markers are the "
            "methods of Nielsen (2015) and methods found here. The strip above a panel marks runs that diverged or are "
            "off the scale."
        ),
    ),
}  # fmt: skip

EXPERIMENT = Experiment(
    name="paper",
    title="The paper",
    about="Energy errors, error terms, perihelion advance, chaos and substeps, as cubes, figures and tables.",
    target="all",
    duration="60 s",
    place=0,
    cubes={
        "sho_terms": ("integrator, first, order", "error terms `kappa` of the oscillator"),
        "henon_heiles_chaos": (
            "orbit, time, component",
            "`lyapunov_exponent` up to each time, t = 2·10⁵ at last, of the paper's orbit of the Hénon-Heiles system "
            "and of a regular one, with a 95 % interval and the energy error of the orbit",
        ),
        "substeps_displaced": (
            "displacement, summation, iteration",
            "panel (D) of Figure 6 from starts beside the plane q_x = 0, over 10⁵ iterations: `left_at`, the "
            "iteration that left the energy surface or 0, `max_energy_error`, and over iterations even in the "
            "logarithm `block_max_energy_error`, the maximum since the previous sample, and `q_x`",
        ),
    },
    tables=(
        "table1_structure", "table2_recursion", "table2_values", "table3_even_orders", "table4_coefficients",
        "integrators",
    ),
    figures=FIGURES,
    others=(
        "tables/skipped.csv", *(f"tables/claims.{ending}" for ending in ("csv", "md", "json")), "report.html",
        *(f"figure-{name}.html" for name in ("gain", *range(1, 7))),
        "figure-{system}_energy_error.html",
    ),
    runs=("{system}/{integrator}/{shard}",),
)  # fmt: skip
