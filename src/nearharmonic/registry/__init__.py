"""Registries of systems and methods, files of users, and display of objects in notebooks."""
