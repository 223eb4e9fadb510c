"""Samplers: gradients of Hamiltonian Monte Carlo with each method, on Gaussians and on targets that are none."""
