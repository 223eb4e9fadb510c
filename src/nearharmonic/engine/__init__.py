"""Exact settings in, trajectories out: grids, batches through the kernel, reference solutions, statistics."""
