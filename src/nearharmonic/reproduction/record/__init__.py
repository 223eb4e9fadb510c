"""What is known of every run of the workflow, and what is asked of it: files only, readable without this package."""
