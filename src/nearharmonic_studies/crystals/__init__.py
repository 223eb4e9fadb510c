"""Crystals: energy errors against temperature and step size, on models of argon, copper, silicon and a chain."""
