"""The grid of runs: which are made, and what is left out."""
