"""Studies beyond the paper: each is a folder that can be deleted."""
