"""Proofs of what a file of coefficients says, and searches for what is wrong with it."""
