"""Methods for quadratic kinetic energy, taken apart for tests: equations and unknowns."""

from nearharmonic_studies.sixth_order.search import NystromEquations


def equations_of(tableau):
    return NystromEquations(tableau.stages, tableau.first, tableau.harmonic_order)


def unknowns_of(tableau):
    return equations_of(tableau).halved(tableau.outer, tableau.inner)
