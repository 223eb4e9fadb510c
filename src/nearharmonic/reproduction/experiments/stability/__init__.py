"""Stress tests: ensembles over energy surfaces, eccentricities and long times, and what becomes of each method."""
