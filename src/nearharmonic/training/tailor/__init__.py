"""A method for one system: coefficients chosen by the energy error on starts near the given one, tested on others."""
