"""Numerical methods that are independent of integrators."""
