"""Figures of the paper, one module each: ``figure(...)`` draws Datasets as a matplotlib Figure, without
computations."""
