"""The paper: energy errors, error terms, perihelion advance and substeps, as figures and tables."""

#: Names of its cubes, those of single systems left out.
CUBES = ("sho_terms",)
