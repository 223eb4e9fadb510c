"""Single orbits: substeps in phase space, paths outside the plane, Lyapunov exponents."""
