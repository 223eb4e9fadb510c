"""Samplers: gradients of Hamiltonian Monte Carlo with each method, on Gaussian and other targets."""
