"""One file for each target of an export: a function of the coefficients that returns a text."""
