"""``nearharmonic export``: coefficients of an integrator for another program, as data or as a running loop."""

from __future__ import annotations

import argparse

from nearharmonic.exchange import TARGETS
from nearharmonic.output.table import Answer

HELP = "write an integrator for another program: as data, or as code with a loop that runs"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("integrator", help="name of an integrator, or FILE.py, or FILE.py:NAME")
    parser.add_argument("--to", required=True, metavar="TARGET", help=f"one of {', '.join(TARGETS)}")
    parser.add_argument(
        "--digits", help="significant digits (default: json and toml all, code those of the nearest doubles)"
    )


def answer(chosen: argparse.Namespace) -> Answer:
    """Return the text for the target."""
    from nearharmonic.engine.settings import one_of, whole_number
    from nearharmonic.exchange.files import export
    from nearharmonic.integrators import integrators

    to = one_of("to", chosen.to, TARGETS)
    digits = None if chosen.digits is None else whole_number(chosen.digits, "digits")
    tableau = integrators[chosen.integrator]
    text = export(tableau, to, digits)
    return Answer(header=["integrator", "to", "text"], rows=[[tableau.name, to, text]], text=text)
