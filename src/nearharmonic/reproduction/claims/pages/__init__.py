"""Pages of verdicts: sums by kind, README, docs/claims.md."""
