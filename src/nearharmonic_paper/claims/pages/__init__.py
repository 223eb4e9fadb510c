"""Pages of verdicts: sums by kind, README, docs/results/claims.md."""
