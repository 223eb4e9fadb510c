"""Statements about methods and their coefficients."""
