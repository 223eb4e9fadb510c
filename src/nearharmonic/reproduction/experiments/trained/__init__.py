"""Methods trained on near-harmonic systems: their search, and the proof on problems that nobody trained on."""
