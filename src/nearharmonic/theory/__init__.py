"""Theory of the integrators: order, stability, the oscillator of a step."""
