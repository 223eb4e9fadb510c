"""Comparison of the splitting with an exactly solved oscillator and the splitting into T and V, on Henon-Heiles."""
