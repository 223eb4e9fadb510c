"""Runs of many step sizes or members in one call of a kernel, and their results."""
