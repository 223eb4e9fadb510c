"""A second program for verdicts on the paper's statements; of the package it takes coefficients alone."""

#: Verdict, and phrases that the value of the committed verdict contains.
Opinion = tuple[str, list[str]]
