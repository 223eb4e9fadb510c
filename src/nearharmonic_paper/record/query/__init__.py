"""Queries of results: a table of single runs, conditions on its columns, and details of one run."""
