"""Chains of Hamiltonian Monte Carlo, and their effective samples."""
