"""Statements about the six figures."""
