"""The paper: energy errors, error terms, perihelion advance and substeps, as figures and tables."""
