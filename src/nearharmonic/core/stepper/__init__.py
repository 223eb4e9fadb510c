"""A single step for functions of numba."""
