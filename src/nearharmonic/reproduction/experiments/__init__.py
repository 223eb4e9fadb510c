"""The experiments, one folder each; none knows another."""
