"""Formulas of a system: traced once as numbers that are symbols, derived, and written as machine code."""
