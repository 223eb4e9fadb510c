"""Long runs of trained methods: trend of the energy error, way back to the start, and error by rounding alone."""
