"""Exact and multiprecision mathematics that knows no integrator: polynomials, words, Lie algebras, roots and proofs."""
