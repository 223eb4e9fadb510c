"""Potentials that are functions of numba."""
