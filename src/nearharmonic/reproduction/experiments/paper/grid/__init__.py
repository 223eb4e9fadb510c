"""The grid of runs, and the omitted runs."""
