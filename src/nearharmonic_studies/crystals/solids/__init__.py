"""Models of crystals in displacements from the lattice sites, with forces compiled by numba."""
