"""Reversibility, symplecticity and mean energy beside what rounding alone gives."""
