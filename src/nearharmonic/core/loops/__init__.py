"""Kernels of many coordinates: expressions that repeat become loops over tables instead of ever longer code."""
