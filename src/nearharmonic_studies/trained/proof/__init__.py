"""Comparison of all methods on problems that were not used in training, and gains of trained methods."""
