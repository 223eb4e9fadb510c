"""Ensembles on energy surfaces of the Henon-Heiles system."""
