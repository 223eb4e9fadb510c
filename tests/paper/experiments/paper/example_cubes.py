"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

from support.cubes import figure_cubes as made


def gains(methods):
    """Errors of Ruth's method, of at most 1 %, and of others."""
    return made.errors(dict.fromkeys(("ruth", *methods))) * 0.1


EXAMPLES = {
    "gain": (gains, ()),
    "gain_mean": (gains, ()),
    "sho_energy_error": (made.errors, ()),
    "fig1_sho": (lambda methods: made.errors(methods, precision=True), ()),
    "fig2_decomposition": (made.terms, ()),
    "fig3_henon_heiles": (made.errors, ()),
    "fig4_perihelion": (made.advances, ("evaluations_per_orbit",)),
    "fig5_kepler": (lambda methods: made.errors(methods, unit="h"), ()),
    "fig6_displaced": (made.displaced, ()),
}
