"""Registries of what there is, users' files, and objects in notebooks."""
