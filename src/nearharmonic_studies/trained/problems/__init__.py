"""Problems for training and tests of methods: random potentials, named systems, orbits."""
