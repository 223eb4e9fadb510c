"""What the paper states, one file for each group of statements."""
