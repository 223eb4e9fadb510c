"""Compiled numerics: arrays in, arrays out; no files, no names, no plotting."""
