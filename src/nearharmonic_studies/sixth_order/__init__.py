"""Search and ranking of methods of order six for quadratic kinetic energy with a higher harmonic order."""
