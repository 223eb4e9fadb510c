"""Exact numbers of a run: coefficients, initial values, moves."""
