"""Comparison of two results: claims, provenance, and all numbers of cubes and tables."""
