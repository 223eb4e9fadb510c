"""Statements of the paper, each with a verdict computed from the results, and the page that shows them."""
