"""Digests and imports of source files: those of the package, and those of users."""
