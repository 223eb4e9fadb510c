"""Coefficients of integrators to and from other programs: files of data, and source code for other languages."""

#: Targets of an export: data formats, then programs.
TARGETS = ("json", "toml", "c", "julia", "rebound", "diffrax", "sundials", "fortran")
