"""Numerical methods that know nothing of integrators."""
