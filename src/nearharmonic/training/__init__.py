"""Training: minimisation of the energy error over an ensemble of problems under exact order conditions."""
