"""Problems that methods are trained and tried on: random potentials, systems with a name, orbits."""
