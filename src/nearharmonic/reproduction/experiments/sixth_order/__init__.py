"""Methods of order six for quadratic kinetic energy that have a harmonic order as well, searched for and ranked."""
