"""Coefficients as files of data, JSON and TOML, with the same keys in both."""

from __future__ import annotations

import json
from typing import Any

from nearharmonic.exchange.method import Coefficients


def document(coefficients: Coefficients) -> dict[str, Any]:
    """Return the keys and values of a file; None marks a property that the integrator does not have."""
    tableau = coefficients.tableau
    return {
        "name": tableau.name,
        "label": tableau.label,
        "source": tableau.source,
        "order": tableau.order,
        "harmonic_order": tableau.harmonic_order,
        "requires": tableau.requires,
        "symmetric": tableau.symmetric,
        "first": tableau.first,
        "digits": coefficients.digits,
        "kick": list(coefficients.kick),
        "drift": list(coefficients.drift),
    }


def write_json(coefficients: Coefficients) -> str:
    """Return the coefficients as JSON; a missing property is null."""
    return json.dumps(document(coefficients), indent=2, ensure_ascii=False) + "\n"


def write_toml(coefficients: Coefficients) -> str:
    """Return the coefficients as TOML, without the keys of missing properties, because TOML has no null."""
    import tomli_w

    return tomli_w.dumps({key: value for key, value in document(coefficients).items() if value is not None})
