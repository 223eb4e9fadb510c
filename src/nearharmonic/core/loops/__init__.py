"""Loops around a step: one trajectory, a queue of runs through the lanes, landing at times, and their kernels."""
