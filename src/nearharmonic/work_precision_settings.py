"""The section ``work_precision`` of a config: what is timed, how finely, and for how long at most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nearharmonic.config import Schema, load, with_defaults
from nearharmonic.errors import UnknownNameError
from nearharmonic.integrators import integrators
from nearharmonic.peers import LIBRARIES, PEERS
from nearharmonic.plan import check_fit
from nearharmonic.settings import checked_tau, one_of
from nearharmonic.systems import systems

#: Holds Nielsen's Table 4, of which his figures show a choice.
PAPER = "nearharmonic.integrators.nielsen_2015"


@dataclass(frozen=True, kw_only=True)
class WorkPrecision:
    """``integrators`` beside those of the figures; step sizes ``points_per_decade``; no run of ours takes more than
    ``evaluations`` of the force, none of the ``peers`` longer than ``longest`` seconds."""

    integrators: tuple[str, ...] = ()
    points_per_decade: int = 8
    evaluations: int = 1_250_000
    peers: tuple[str, ...] = field(default_factory=lambda: tuple(PEERS))
    longest: float = 0.25


def load_work_precision(mapping: Mapping[str, Any], schema: Schema) -> WorkPrecision:
    """The settings of the section ``work_precision`` of the config ``mapping``.

    Raises:
        NearharmonicError: the first fault found, in this section or elsewhere in the config: an unknown integrator or
            library, a method that a system does not fit, or a number outside what is allowed.
    """
    config = load(mapping, schema)
    key = "work_precision"
    asked = with_defaults(mapping, schema)[key]
    for name in asked.get("integrators", ()):
        try:
            tableau = integrators[name]
        except UnknownNameError as error:
            message = f"{key}.integrators: {error}"
            raise UnknownNameError(message) from None
        for sweep in config.sweeps:
            check_fit(systems[sweep.system], tableau)
    libraries = [one_of(f"{key}.peers[{i}]", name, LIBRARIES) for i, name in enumerate(asked["peers"])]
    beside = asked.get("integrators", [name for name in integrators if integrators.module_of(name) != PAPER])
    return WorkPrecision(
        integrators=tuple(name for name in beside if name not in config.integrators),
        points_per_decade=asked["points_per_decade"],
        evaluations=asked["evaluations"],
        peers=tuple(name for name, peer in PEERS.items() if peer.module in libraries),
        longest=checked_tau(asked["longest"], f"{key}.longest"),
    )
