"""User interface of runs: trajectories, sweeps, ensembles, prepared problems, and their datasets."""
