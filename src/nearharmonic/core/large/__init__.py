"""Systems of many coordinates in memory: blocks of eight coordinates, and long sums as loops."""
