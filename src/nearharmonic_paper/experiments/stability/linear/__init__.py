"""Linear stability: step sizes for which the harmonic oscillator stays bounded."""
