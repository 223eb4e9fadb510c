"""Statements of the paper, one file for each group."""
