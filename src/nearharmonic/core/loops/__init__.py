"""Loops over steps: one trajectory, a queue of runs for SIMD lanes, samples at physical times, and kernels."""
