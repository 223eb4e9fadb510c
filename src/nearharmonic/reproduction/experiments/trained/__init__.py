"""Methods trained on near-harmonic systems: their search, and the proof on problems that nobody trained on."""

#: Names of its cubes.
CUBES = ("trained", "trained_ideas")
