"""Starts that a method is tailored on."""
