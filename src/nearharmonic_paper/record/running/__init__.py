"""A run of the workflow: its lock, what it repairs at its start, and its record."""
