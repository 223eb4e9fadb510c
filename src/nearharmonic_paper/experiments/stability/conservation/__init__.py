"""Reversibility, symplecticity and mean energy, compared with pure rounding errors."""
