"""Beyond the paper: methods of order six for quadratic kinetic energy that have a harmonic order as well."""
