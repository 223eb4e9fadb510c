"""Declaration of the paper's experiment, which the default target makes."""

from nearharmonic_paper.tasks.experiment import Experiment

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
        "table1_structure",
        "table2_recursion",
        "table2_values",
        "table3_even_orders",
        "table4_coefficients",
        "integrators",
    ),
    figures={
        "fig1_sho": "Energy error of the oscillator",
        "fig2_decomposition": "Error terms of the harmonic oscillator",
        "fig3_henon_heiles": "Energy error of the Hénon-Heiles system",
        "fig4_perihelion": "Advance of the perihelion against force evaluations per orbit",
        "fig5_kepler": "Energy error of the Sun-Mercury system",
        "fig6_substeps": "Substeps in phase space",
        "fig6_displaced": "Panel (D) of Figure 6 beside its plane",
        "{system}_energy_error": "Energy error",
    },
    others=(
        "tables/skipped.csv",
        "tables/claims.csv",
        "tables/claims.md",
        "tables/claims.json",
        "report.html",
        *(f"figure-{number}.html" for number in range(1, 7)),
        "figure-{system}_energy_error.html",
    ),
    runs=("{system}/{integrator}/{shard}",),
)
