"""Searches for solutions: random starts, the adaptive simplex, their kernels."""
