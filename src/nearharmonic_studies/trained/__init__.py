"""Methods trained on near-harmonic systems: their search, and the comparison on other problems."""
