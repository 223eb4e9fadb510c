"""Derivation of splitting coefficients: harmonic order conditions, their solutions, and proofs of completeness.

``conditions`` states the conditions, and ``starts`` finds solutions in double from random starts. ``elimination`` finds
all solutions exactly if there are no free parameters. ``isolated`` combines both and proves each solution. ``families``
compares the solutions with the printed sets. ``simplex`` is the method of the paper.
"""
