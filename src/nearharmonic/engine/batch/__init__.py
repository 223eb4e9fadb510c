"""Runs of many step sizes or members in one call of a kernel, and what a kernel gives back."""
