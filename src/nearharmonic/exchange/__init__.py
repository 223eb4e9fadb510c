"""Coefficients of integrators to and from other programs: files of data, and source code for other languages."""

#: What an integrator is exported to: data, then programs.
TARGETS = ("json", "toml", "c", "julia", "rebound", "diffrax", "sundials", "fortran")
