"""A second program for verdicts on the paper's statements; it shares no code with the package."""

#: Verdict, and phrases that the value of the committed verdict contains.
Opinion = tuple[str, list[str]]
