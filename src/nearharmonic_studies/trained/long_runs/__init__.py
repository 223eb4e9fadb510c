"""Long runs of trained methods: trend of the energy error, backward runs, and pure rounding errors."""
