"""Kepler orbits over eccentricity and step size."""
