"""Proofs about a tableau without integration: error terms, orders, and limits of linear stability."""
