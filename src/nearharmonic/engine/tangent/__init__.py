"""Derivatives of discrete runs: deviations from orbits and their indicators of chaos, and gradients of observables."""
