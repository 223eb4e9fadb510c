"""Energy errors of the harmonic oscillator after one step, over the step size."""
