"""Formulas of systems: energies, gradients, kinetic energies, the oscillator, regularisations."""
