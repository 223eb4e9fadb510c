"""The command ``nearharmonic``: which method for which error, and what there is."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from typing import NoReturn

from nearharmonic.curve import MEASURES
from nearharmonic.errors import NearharmonicError, SettingError


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are errors of the package: one message, status 1."""

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
    """Run the command; returns its exit status, 1 after an error, of which it prints one message."""
    try:
        chosen = parser().parse_args(arguments)
        _print(_recommend(chosen) if chosen.command == "recommend" else _list(chosen.kind))
    except NearharmonicError as error:
        sys.stderr.write(f"nearharmonic: {error}\n")
        return 1
    except BrokenPipeError:  # the reader, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return 0


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _recommend(chosen: argparse.Namespace) -> Iterable[str]:
    from nearharmonic.recommend import lines, recommend

    return lines(recommend(chosen.system, chosen.error, measure=chosen.measure, results=chosen.results))


def _list(kind: str | None) -> Iterable[str]:
    from nearharmonic.recommend import registry_lines

    for each in (kind,) if kind else ("integrators", "systems"):
        yield from registry_lines(each)


if __name__ == "__main__":
    sys.exit(main())
