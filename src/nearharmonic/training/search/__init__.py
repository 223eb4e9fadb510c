"""Searches for members of a family: starts, descents by Gauss-Newton steps or an evolution, and their results."""
