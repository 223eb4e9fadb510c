"""Derivation of splitting coefficients: harmonic order conditions, their solutions, and proofs of completeness."""
