"""Two results side by side: claims, what made them, every number of cubes and tables."""
