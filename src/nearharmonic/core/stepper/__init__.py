"""A step by itself, for functions of numba."""
