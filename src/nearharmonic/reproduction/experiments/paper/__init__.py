"""The paper: energy errors, error terms, perihelion advance, chaos and substeps, as cubes, figures and tables."""

#: Names of its cubes, those of single systems left out.
CUBES = ("sho_terms", "henon_heiles_chaos", "substeps_displaced")
