"""Compiled numerics on arrays, without files, registries and plots."""
