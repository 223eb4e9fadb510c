"""Formulas as expressions: traced once, simplified, differentiated, and evaluated on numbers of any type."""
