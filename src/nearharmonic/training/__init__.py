"""Coefficients chosen by the energy error itself, over an ensemble of problems, with order conditions met exactly."""
