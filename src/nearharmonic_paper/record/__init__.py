"""Record of every run of the workflow, and queries of it: files only, readable without this package."""
