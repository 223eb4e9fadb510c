"""Splitting coefficients from nothing: the harmonic order conditions, their solutions, and proofs that none lacks.

``conditions`` states the conditions, and ``starts`` finds solutions in double from random starts. ``elimination`` finds
all of them exactly where the conditions leave nothing free; ``isolated`` joins both and proves each solution.
``families`` compares with the printed sets, and ``simplex`` is the route of the paper.
"""
