"""Statements about equations, and their misprints."""
