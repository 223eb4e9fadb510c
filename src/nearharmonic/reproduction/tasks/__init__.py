"""Jobs of the workflow: what a rule names, what it depends on, and what it has written."""
