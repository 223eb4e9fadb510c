"""Experiments, one folder each with its declaration in the module ``experiment``; none knows another."""
