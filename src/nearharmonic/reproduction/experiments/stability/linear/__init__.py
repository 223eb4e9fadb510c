"""Linear stability: where the harmonic oscillator stays bounded."""
