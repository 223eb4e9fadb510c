"""Jobs of the workflow: tasks of rules, their dependencies, and the files that they have written."""
