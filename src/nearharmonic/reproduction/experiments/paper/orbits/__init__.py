"""Single orbits: substeps in phase space, paths beside the plane, Lyapunov exponents."""
