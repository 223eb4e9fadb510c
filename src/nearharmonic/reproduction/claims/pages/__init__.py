"""Pages that show verdicts: sums by kind, README, docs/claims.md."""
