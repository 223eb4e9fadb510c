"""The paper: energy errors, error terms, perihelion advance, chaos and substeps, as cubes, figures and tables."""
