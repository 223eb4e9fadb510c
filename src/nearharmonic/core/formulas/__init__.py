"""Formulas of a system: traced once with symbolic numbers, differentiated, and written as machine code."""
