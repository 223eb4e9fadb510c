"""Stress tests: ensembles over energy surfaces, eccentricities and long times, and what becomes of each method."""

#: Names of its cubes.
CUBES = (
    "linear_stability",
    "structure",
    "kinetic_energy",
    "stability_henon_heiles",
    "stability_kepler",
    "stability_rounding",
)
