"""Steps of implicit collocation methods, with all stages of a step side by side in SIMD lanes."""
