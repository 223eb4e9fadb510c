"""Error terms of the oscillator: errors of the position after one step, order by order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np
import xarray as xr

from nearharmonic.exact.polynomials import BigFloat
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.output.store import assembled, coordinate, method_coordinates, variable
from nearharmonic.theory.order import harmonic_order
from nearharmonic.theory.oscillator import kappa, lambda_max

#: Decimals from which rounded coefficients leave terms far below 1e-30: the ten benchmarked methods have as many.
MANY_DIGITS = 39


def decompose(integrators: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``cube`` of position error terms kappa over (integrator, first, order).

    Terms are up to the highest order of each composition, and NaN in the exchanged role of a method with modified
    potentials, which does not exist.
    """
    tableaus, roles = [registry[name] for name in integrators], get_args(First)
    terms = [[_terms(t, first) for first in roles] for t in tableaus]
    highest = max(len(row) for rows in terms for row in rows)
    values = [[[*map(float, row), *[np.nan] * (highest - len(row))] for row in rows] for rows in terms]
    text = "position error term kappa of the harmonic oscillator; kick first is BAB, drift first is ABA"
    variables = {
        **method_coordinates(tableaus),
        **coordinate("first", roles, "operator that comes first"),
        **coordinate("order", np.arange(1, highest + 1), "order lambda in tau"),
        "kappa": variable(("integrator", "first", "order"), values, text),
    }
    return {"cube": assembled(variables, ["label"], {})}


def _terms(tableau: Tableau, first: First) -> list[BigFloat]:
    """Return the terms; those that vanish to the digits of a method of few digits are 0, not their rounding errors."""
    if tableau.modified and first != tableau.first:
        return []
    terms = kappa(tableau, lambda_max(tableau, first=first), first=first)
    vanishing = harmonic_order(tableau, first=first) if tableau.digits < MANY_DIGITS else 0
    return [*(0 * term for term in terms[:vanishing]), *terms[vanishing:]]
