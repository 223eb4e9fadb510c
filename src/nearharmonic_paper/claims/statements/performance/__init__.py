"""Statements that compare methods over systems."""
