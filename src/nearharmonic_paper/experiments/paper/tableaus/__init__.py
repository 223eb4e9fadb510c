"""Tables of methods, and their error terms on the oscillator."""
