"""Searches for methods with few gradients, and what limits them."""
