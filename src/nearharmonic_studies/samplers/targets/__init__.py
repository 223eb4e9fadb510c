"""Targets of Hamiltonian Monte Carlo that are not Gaussian, as potentials with compiled gradients."""
