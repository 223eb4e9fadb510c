"""Figures of the paper, one module each: ``figure(...)`` takes Datasets and returns a matplotlib Figure, no maths."""
