"""Systems of many coordinates, which lie in memory: eight at a time, and sums over long ranges as loops."""
