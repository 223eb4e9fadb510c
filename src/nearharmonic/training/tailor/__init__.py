"""A method for one system: its coefficients minimise the energy error on starts near the given one."""
