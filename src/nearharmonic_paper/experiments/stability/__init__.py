"""Stress tests of all methods: ensembles over energy surfaces, eccentricities and long times."""
