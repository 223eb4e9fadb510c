"""Proofs of the claims of a coefficient file, and searches for its errors."""
