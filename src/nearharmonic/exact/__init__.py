"""Exact and multiprecision mathematics, independent of integrators: polynomials, words, Lie algebras, roots, proofs."""
