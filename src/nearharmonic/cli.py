"""The command ``nearharmonic``: which method for which error, and what there is."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from typing import NoReturn

from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.experiments.work_precision.curve import MEASURES


class _Parser(argparse.ArgumentParser):
    """An argument parser that raises its complaints as errors of the package, for one message and one exit status."""

    def error(self, message: str) -> NoReturn:
        hint = f"{message}. See: {self.prog} --help"
        raise SettingError(hint)


def parser() -> argparse.ArgumentParser:
    """The arguments of the command."""
    top = _Parser(prog="nearharmonic", description="Near-harmonic symplectic integrators, timed against their error.")
    commands = top.add_subparsers(dest="command", metavar="command", required=True)
    rank = commands.add_parser("recommend", help="rank methods by the time to reach an error")
    rank.add_argument("system", help="name of a system, or a Python file that defines SYSTEM")
    rank.add_argument("--error", required=True, help="the error that is allowed, such as 1e-9")
    rank.add_argument("--measure", default="max", help=f"one of {', '.join(MEASURES)} (default max)")
    rank.add_argument("--results", default="results/paper", help="folder with timings (default results/paper)")
    listing = commands.add_parser("list", help="list the integrators or the systems")
    listing.add_argument("kind", nargs="?", choices=("integrators", "systems"), help="both if not given")
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments
        Words after the name of the command; None takes those of the process.

    Returns
    -------
    int
        Exit status: 0 yes, 1 no method meets the error bound, 2 bad input, of which one message is printed.
    """
    try:
        chosen = parser().parse_args(arguments)
        return _recommend(chosen) if chosen.command == "recommend" else _list(chosen.kind)
    except NearharmonicError as error:
        sys.stderr.write(f"nearharmonic: {error}\n")
        return 2


def _print(lines: Iterable[str]) -> None:
    try:
        for line in lines:
            sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _recommend(chosen: argparse.Namespace) -> int:
    from nearharmonic.experiments.work_precision.recommend.choices import recommend
    from nearharmonic.listing import recommendation_lines

    found = recommend(chosen.system, chosen.error, measure=chosen.measure, results=chosen.results)
    _print(recommendation_lines(found))
    return 0 if found.ranked else 1


def _list(kind: str | None) -> int:
    from nearharmonic.listing import registry_lines

    for each in (kind,) if kind else ("integrators", "systems"):
        _print(registry_lines(each))
    return 0


if __name__ == "__main__":
    sys.exit(main())
