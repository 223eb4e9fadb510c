"""Energy errors for a kinetic energy that is not quadratic."""
