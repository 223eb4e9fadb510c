"""Starts on which a method is tailored."""
