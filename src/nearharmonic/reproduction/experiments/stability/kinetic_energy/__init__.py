"""Energy errors where the kinetic energy is not quadratic."""
