"""``nearharmonic list``: lists of the integrators, of two kinds of them, and of the systems."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Answer

if TYPE_CHECKING:
    from nearharmonic.integrators.tableau import Tableau

HELP = "list the integrators or the systems"
KINDS = ("integrators", "modified_integrators", "implicit_integrators", "systems")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("kind", nargs="?", help=f"{', '.join(KINDS[:-1])} or {KINDS[-1]}; all if not given")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each integrator or system, in the order of the registries."""
    from nearharmonic.engine.settings import one_of

    kinds = (KINDS[0], KINDS[-1]) if chosen.kind is None else (one_of("kind", chosen.kind, KINDS),)
    found = [described for kind in kinds for described in _described(kind)]
    names = dict.fromkeys(name for described in found for name in described if name != "source")
    header = [*(name for name in names if name != "kind" or len(kinds) > 1), "source"]
    return Answer(header=header, rows=[[described.get(name) for name in header] for described in found])


def _described(kind: str) -> list[dict[str, Any]]:
    """Return the facts of all members of one of :data:`KINDS`."""
    from nearharmonic import integrators
    from nearharmonic.systems import systems

    if kind != "systems":
        chosen = integrators if kind == "integrators" else getattr(integrators, kind)
        return [_method(t) for t in chosen.values()]
    return [
        {
            "kind": "system",
            "name": s.name,
            "label": s.label,
            "coordinates": s.dimension,
            "t_end": s.t_end,
            "unit of t": s.units["t"],
            "source": s.source,
        }
        for s in systems.values()
    ]


def _method(t: Tableau) -> dict[str, Any]:
    from nearharmonic.theory.order import harmonic_order

    return {
        "kind": "implicit integrator" if t.implicit else "modified integrator" if t.modified else "integrator",
        "name": t.name,
        "label": t.label,
        "stages": t.stages,
        "gradients": 0 if t.implicit else t.gradients,
        "order": t.order,
        "harmonic order": harmonic_order(t),
        "first": "" if t.implicit else t.first,
        "source": f"{t.source}; requires a {t.requires}" if t.requires else t.source,
    }
