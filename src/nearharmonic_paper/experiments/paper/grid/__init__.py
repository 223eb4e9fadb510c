"""The grid of runs: its plan, its shards, the omitted runs, and those taken over from an earlier plan."""
