"""Splitting coefficients from nothing: the harmonic order conditions, their solutions, and proofs that none lacks.

``equations`` states the conditions, ``search`` finds solutions in double from random starts, ``polish`` refines them
and ``proof`` encloses them; ``elimination`` finds all of them exactly where the conditions leave nothing free;
``simplex`` is the route of the paper.
"""
