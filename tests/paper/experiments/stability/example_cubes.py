"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

from support.cubes import stability_cubes as made

EXAMPLES = {
    "linear_stability": (made.traces, ()),
    "kinetic_energy": (made.amplitudes, ()),
    "henon_heiles_stability": (made.ensembles, ()),
    "kepler_stability": (made.orbits, ("evaluations_per_orbit",)),
    "rounding_growth": (made.rounding, ("time",)),
}
