"""What users call: trajectories, sweeps, ensembles, prepared problems, and their datasets."""
