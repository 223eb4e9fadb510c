"""Queries of results: a table of single runs, conditions on its columns, and all that is known of one run."""
